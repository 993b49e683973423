"use strict";
// A team: robots that see one picture, each on a small stage, and the votes their walks come to. For the page of `serve` and for
// reports; after drawing.js.
const Stages = (() => {
  const { css, element, fit } = Drawing;

  // How a body stands: where its centre of mass is, and its points [voxel lengths].
  const stand = (x, points) => ({ x, points });

  // What a team says, in words; a tie names all classes that share most votes, and how it is broken.
  const said = (tally, names) => {
    if (tally?.says === null || tally?.says === undefined) return { says: "", tie: "" };
    const says = names.name(tally.says), tied = tally.tied ?? [];
    if (tied.length < 2) return { says, tie: "" };
    const all = tied.map(names.name), by = tally.tie_broken_by === "order" ? "the first counts," : "the longer walks decide for";
    return { says: `${all.slice(0, -1).join(", ")} or ${all.at(-1)}`, tie: `a tie; ${by} ${says}` };
  };

  class Team {
    // Members: robot, task, judge, voxels, and how many points. `materials`: areas and list, as Drawing has them. `given`: names of classes.
    constructor(stages, tally, { members, classes, class_names: given, threshold, materials }) {
      Object.assign(this, { members, classes, threshold, materials });
      const { name, side } = Drawing.classNames(given);
      this.stages = members.map(({ robot, task, judge, voxels, points }) => {
        const canvas = element("canvas"), sides = (way) => side(judge[way]);
        const label = element("figcaption", {}, element("b", { textContent: "← " + sides("left") }), element("b", { textContent: sides("right") + " →" }));
        const figure = element("figure", { title: `${robot}: ${task}` }, canvas, label);
        figure.dataset.task = task;
        return { canvas, figure, sides: Drawing.sidesOf(voxels, points), room: null };
      });
      const least = members.length > 24 ? 84 : members.length > 8 ? 120 : 190;
      stages.style.gridTemplateColumns = `repeat(auto-fill, minmax(min(${least}px, 45%), 1fr))`;
      stages.replaceChildren(...this.stages.map((stage) => stage.figure));
      this.bars = classes.map((label) => element("li", {}, element("b", { textContent: name(label), title: given?.[label] ?? "" }), element("i"), element("span")));
      tally.replaceChildren(...this.bars);
      tally.parentElement.toggleAttribute("data-named", !!given);
      const known = (label) => members.filter(({ judge }) => judge.left.concat(judge.right).includes(label)).length;
      this.most = Math.max(1, ...classes.map(known));
    }

    // How each robot stands and stood at first, and what walks come to: moved, votes, and the class they say.
    draw(stands, starts, tally) {
      this.members.forEach((member, k) => {
        const moved = tally?.moved[k] ?? 0;
        this.stages[k].figure.dataset.way = Math.abs(moved) > this.threshold ? (moved > 0 ? "right" : "left") : "";
        this.robot(this.stages[k], member, stands[k], starts[k]);
      });
      this.classes.forEach((label, k) => {
        const votes = tally?.votes[k] ?? 0, [, bar, text] = this.bars[k].children;
        bar.style.width = `${(100 * votes) / this.most}%`;
        text.textContent = votes;
        this.bars[k].dataset.leads = String(tally?.tied?.length > 1 ? tally.tied.includes(label) : tally?.says === label);
      });
    }

    // A body on its small stage; the camera keeps its start in the middle as long as it can.
    robot(stage, { voxels }, { x, points }, begin) {
      const { canvas, sides } = stage, width = canvas.parentElement.clientWidth, height = Math.round(0.62 * width), ground = 7;
      const ctx = fit(canvas, width, height), surface = height - ground;
      if (stage.begin !== begin) Object.assign(stage, { begin, room: new Drawing.Room(begin.points, begin.x) });
      const { room } = stage, body = room.take(points, x);
      const scale = Math.min(width / (2.1 * room.size + 6), (surface - 4) / (1.1 * room.tall));
      const middle = Drawing.camera(begin.x, body, width / scale, 0.5), x0 = middle - width / 2 / scale;
      const X = (at) => Math.min(Math.max((at - x0) * scale, -999), 9999), Y = (at) => Math.min(Math.max(surface - at * scale, -999), 9999);
      ctx.fillStyle = css("sky"); ctx.fillRect(0, 0, width, height);
      ctx.fillStyle = css("ground"); ctx.fillRect(0, surface, width, ground);
      ctx.strokeStyle = css("mark"); ctx.lineWidth = 1; ctx.setLineDash([3, 3]);
      ctx.beginPath(); ctx.moveTo(X(begin.x), 0); ctx.lineTo(X(begin.x), surface); ctx.stroke(); ctx.setLineDash([]);
      Drawing.robot(ctx, { voxels, points, sides, areas: this.materials.areas, materials: this.materials.list }, { X, Y, scale });
    }
  }

  return { Team, said, stand };
})();
