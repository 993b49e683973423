// A team: robots of several tasks see one picture, each on a small stage, and their walks are counted while they walk.

import { $, bytes, element, get, post, stream } from "./api.js";

const { css, fit } = Drawing;
const NOWHERE = -32768;

export class Team {
  constructor(materials, changed) { this.materials = materials; this.changed = changed; this.members = []; this.walk = null; }

  // Who is in it; the tab is there if there is a team.
  async load() {
    const { members, classes } = await get("/api/team");
    this.members = members; this.classes = classes;
    $("tab-team").hidden = members.length === 0;
    $("about-team").textContent = `${members.length} robots, each of which tells two groups of classes apart, answer together. Each has one vote for every class of the side it walks to; a walk of at most 3 voxel lengths gives none.`;
  }

  get over() { return !!this.walk?.end; }

  start(shown, speed) {
    this.stop();
    const walk = this.walk = { abort: new AbortController(), begun: null, frames: [], tally: null, step: 0, end: false, paused: false };
    const hear = (name, data) => {
      if (this.walk !== walk) return;
      if (name === "begin") { walk.begun = data; walk.frames = data.members.map((member) => member.frames); walk.starts = walk.frames.map((text, k) => place(text, data.members[k].points, data.unit)); this.build(); }
      if (name === "moment") { walk.step = data.step; data.frames.forEach((frame, k) => { walk.frames[k] = frame ?? walk.frames[k]; }); walk.tally = data.tally; }
      if (name === "end") { walk.step = data.step; walk.tally = data.tally; walk.end = true; }
      walk.stale = true;
      this.changed(name, walk);
    };
    return stream("/api/team", { shown, speed }, walk.abort.signal, hear).finally(() => { if (this.walk === walk) { walk.end = true; walk.stale = true; } });
  }

  stop() { this.walk?.abort.abort(); this.walk = null; }

  // While it walks: the pace, and standing still.
  change(value) {
    if (!this.walk?.begun || this.walk.end) return Promise.resolve();
    if (value.paused !== undefined) this.walk.paused = value.paused;
    return post("/api/simulations/" + this.walk.begun.id, value).catch((error) => { if (error.status !== 404) throw error; });
  }

  build() {
    const { members, classes } = this.walk.begun;
    this.stages = members.map(({ name, voxels, points }) => {
      const canvas = element("canvas"), sides = (way) => name.judge[way].join(" ");
      const label = element("figcaption", {}, element("b", { textContent: "← " + sides("left") }), element("b", { textContent: sides("right") + " →" }));
      const figure = element("figure", { title: `${name.robot}: ${name.task}` }, canvas, label);
      figure.dataset.task = name.task;
      return { canvas, figure, sides: Drawing.sidesOf(voxels, points) };
    });
    const least = members.length > 24 ? 84 : members.length > 8 ? 120 : 190;
    $("stages").style.gridTemplateColumns = `repeat(auto-fill, minmax(min(${least}px, 45%), 1fr))`;
    $("stages").replaceChildren(...this.stages.map((stage) => stage.figure));
    this.bars = classes.map((label) => element("li", {}, element("b", { textContent: label }), element("i"), element("span")));
    $("tally").replaceChildren(...this.bars);
  }

  draw() {
    const walk = this.walk;
    if (!walk?.begun || !walk.stale) return;
    walk.stale = false;
    const { begun, tally } = walk, most = Math.max(1, begun.members.length && Math.max(...begun.classes.map((label) => begun.members.filter(({ name: { judge } }) => judge.left.concat(judge.right).includes(label)).length)));
    begun.members.forEach((member, k) => {
      const moved = tally?.moved[k] ?? 0, way = Math.abs(moved) > begun.threshold ? (moved > 0 ? "right" : "left") : "";
      this.stages[k].figure.dataset.way = way;
      this.robot(this.stages[k], member, place(walk.frames[k], member.points, begun.unit), walk.starts[k]);
    });
    begun.classes.forEach((label, k) => {
      const votes = tally?.votes[k] ?? 0, [, bar, text] = this.bars[k].children;
      bar.style.width = `${(100 * votes) / most}%`;
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

// A moment: where the centre of mass is, all points in voxel lengths, and how large the body is.
const place = (text, count, unit) => {
  const raw = bytes(text), head = new DataView(raw.buffer), x = head.getFloat64(0, true), y = head.getFloat64(8, true);
  const at = (i) => head.getInt16(16 + 2 * i, true);
  const points = Array.from({ length: count }, (_, i) => (at(2 * i) === NOWHERE ? null : [at(2 * i) / unit + x, at(2 * i + 1) / unit + y]));
  const known = points.filter(Boolean);
  const size = Math.max(1, ...known.map((q) => 2 * Math.abs(q[0] - x))), tall = Math.max(1, ...known.map((q) => q[1]));
  return { x, points, size, tall };
};
