"use strict";
// A team: robots that see one picture, each on a small stage, and the votes their walks come to. For the page of `serve` and for
// reports; after drawing.js.
const Stages = (() => {
  const { css, element, fit } = Drawing;

  // How a body stands: where its centre of mass is, its points, and how large it is [voxel lengths].
  const stand = (x, points) => {
    const known = points.filter(Boolean);
    const size = Math.max(1, ...known.map((q) => 2 * Math.abs(q[0] - x))), tall = Math.max(1, ...known.map((q) => q[1]));
    return { x, points, size, tall };
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
        return { canvas, figure, sides: Drawing.sidesOf(voxels, points) };
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
        this.bars[k].dataset.leads = String(tally?.says === label);
      });
    }

    // A body on its small stage; the camera keeps its start in the middle as long as it can.
    robot({ canvas, sides }, { voxels }, { x, points }, { x: begin, size, tall }) {
      const width = canvas.parentElement.clientWidth, height = Math.round(0.62 * width), ground = 7;
      const ctx = fit(canvas, width, height), surface = height - ground;
      const scale = Math.min(width / (2.1 * size + 6), (surface - 4) / (1.25 * tall)), room = Math.max(0, width / scale / 2 - size / 2);
      const middle = Math.min(Math.max(begin, x - room), x + room), x0 = middle - width / 2 / scale;
      const X = (at) => Math.min(Math.max((at - x0) * scale, -999), 9999), Y = (at) => Math.min(Math.max(surface - at * scale, -999), 9999);
      ctx.fillStyle = css("sky"); ctx.fillRect(0, 0, width, height);
      ctx.fillStyle = css("ground"); ctx.fillRect(0, surface, width, ground);
      ctx.strokeStyle = css("mark"); ctx.lineWidth = 1; ctx.setLineDash([3, 3]);
      ctx.beginPath(); ctx.moveTo(X(begin), 0); ctx.lineTo(X(begin), surface); ctx.stroke(); ctx.setLineDash([]);
      Drawing.robot(ctx, { voxels, points, sides, areas: this.materials.areas, materials: this.materials.list }, { X, Y, scale });
    }
  }

  return { Team, stand };
})();
