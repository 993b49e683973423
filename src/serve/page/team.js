// A team: robots of several tasks see one picture, each on a small stage, and their walks are counted while they walk.

import { $, bytes, get, post, stream } from "./api.js";

const NOWHERE = -32768;

export class Team {
  constructor(materials, changed) { this.materials = materials; this.changed = changed; this.members = []; this.walk = null; }

  // Who is in it.
  async load() {
    const { members, classes, class_names } = await get("api/team");
    this.members = members; this.classes = classes; this.class_names = class_names; this.names = Drawing.classNames(class_names);
    $("about-team").textContent = `${members.length} robots, each of which tells two groups of classes apart, answer together. Each has one vote for every class of the side it walks to; a walk of at most 3 voxel lengths gives none.`;
  }

  get over() { return !!this.walk?.end; }

  start(shown, speed) {
    this.stop();
    const walk = this.walk = { abort: new AbortController(), begun: null, frames: [], tally: null, step: 0, behind: null, end: false, paused: false };
    const hear = (name, data) => {
      if (this.walk !== walk) return;
      if (name === "begin") { walk.begun = data; walk.frames = data.members.map((member) => member.frames); walk.starts = walk.frames.map((text, k) => place(text, data.members[k].points, data.unit)); this.build(); }
      if (name === "moment") { walk.step = data.step; walk.behind = data.behind ?? null; data.frames.forEach((frame, k) => { walk.frames[k] = frame ?? walk.frames[k]; }); walk.tally = data.tally; }
      if (name === "end") { walk.step = data.step; walk.behind = null; walk.tally = data.tally; walk.end = true; }
      walk.stale = true;
      this.changed(name, walk);
    };
    return stream("api/team", { shown, speed }, walk.abort.signal, hear).finally(() => { if (this.walk === walk) { walk.end = true; walk.stale = true; } });
  }

  stop() { this.walk?.abort.abort(); this.walk = null; }

  // While it walks: the pace, and standing still.
  change(value) {
    if (!this.walk?.begun || this.walk.end) return Promise.resolve();
    if (value.paused !== undefined) this.walk.paused = value.paused;
    return post("api/simulations/" + this.walk.begun.id, value).catch((error) => { if (error.status !== 404) throw error; });
  }

  build() {
    const { members, classes, class_names, threshold } = this.walk.begun;
    const robots = members.map(({ name, voxels, points }) => ({ ...name, voxels, points }));
    this.stages = new Stages.Team($("stages"), $("tally"), { members: robots, classes, class_names, threshold, materials: this.materials });
  }

  draw() {
    const walk = this.walk;
    if (!walk?.begun || !walk.stale) return;
    walk.stale = false;
    const { members, unit } = walk.begun;
    this.stages.draw(walk.frames.map((text, k) => place(text, members[k].points, unit)), walk.starts, walk.tally);
  }
}

// A moment, as the server packs it: how a body stands.
const place = (text, count, unit) => {
  const raw = bytes(text), head = new DataView(raw.buffer), x = head.getFloat64(0, true), y = head.getFloat64(8, true);
  const at = (i) => head.getInt16(16 + 2 * i, true);
  const points = Array.from({ length: count }, (_, i) => (at(2 * i) === NOWHERE ? null : [at(2 * i) / unit + x, at(2 * i + 1) / unit + y]));
  return Stages.stand(x, points);
};
