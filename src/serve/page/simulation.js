// A simulation as it comes from the server, kept moment by moment, and where in it we look.

import { bytes, post, stream } from "./api.js";

export class Simulation {
  constructor(request, speed, changed) {
    this.moments = []; this.phases = []; this.end = null; this.begun = null;
    this.at = 0; this.speed = speed; this.playing = true; this.waiting = null; this.changed = changed;
    // Whether we look at a moment of our own choice and not at the newest.
    this.apart = false;
    this.abort = new AbortController();
    this.running = stream("api/simulations", { ...request, speed }, this.abort.signal, (name, data) => this.hear(name, data));
  }

  hear(name, data) {
    if (name === "begin") {
      this.begun = data; this.keep(data.frames); this.phases.push(data.seen);
      if (this.waiting) this.change(this.waiting).catch(() => {});
    }
    if (name === "seen") this.phases.push(data);
    if (name === "moments") { this.keep(data.frames); this.answer = data.answer; }
    if (name === "end") { this.end = data; this.answer = data.answer; }
    this.changed(name);
  }

  keep(text) {
    const raw = bytes(text), P = this.begun.points, size = 16 + 4 * P;
    for (let at = 0; at < raw.length; at += size) {
      const head = new DataView(raw.buffer, at, size), points = new Int16Array(2 * P);
      for (let i = 0; i < 2 * P; i++) points[i] = head.getInt16(16 + 2 * i, true);
      this.moments.push({ x: head.getFloat64(0, true), y: head.getFloat64(8, true), points });
    }
  }

  get last() { return this.moments.length - 1; }
  get frame() { return Math.min(Math.floor(this.at), this.last); }
  // Up to where the simulation goes: the phase that is shown last.
  get until() { return this.end ? this.last : this.phases.length ? this.phases[this.phases.length - 1].until : 500; }
  get over() { return this.end !== null && this.frame >= this.last; }

  phase(frame) {
    let k = this.phases.length - 1;
    while (k > 0 && this.phases[k].step > frame) k--;
    return this.phases[k];
  }

  moved(frame) { return this.moments[frame].x - this.moments[Math.min(this.phase(frame).step, this.last)].x; }

  // The answer so far: to the last moment the server's own, before that worked out in the same way.
  answered(frame) {
    const moved = frame === this.last && this.answer ? this.answer.moved : this.moved(frame);
    const way = Math.abs(moved) > this.begun.threshold ? (moved > 0 ? "right" : "left") : null;
    return { moved, way, says: way && this.begun.judge ? this.begun.judge[way] : [] };
  }

  // Time passes in the page. Behind what has come by more than a moment's jitter, it hurries.
  pass(seconds) {
    if (!this.begun || !this.playing) return;
    const rate = this.begun.rate * (this.speed || 16), behind = this.last - this.at;
    if (!this.apart && (behind > 2 * rate || (this.speed === 0 && !this.end))) this.at = this.last;
    else {
      const hurry = this.end || this.apart ? 1 : behind > 0.5 * rate ? 3 : behind > 0.16 * rate ? 1.25 : 1;
      this.at = Math.min(this.last, this.at + seconds * rate * hurry);
    }
  }

  look(frame) { this.at = Math.min(frame, this.last); this.apart = this.at < this.last; }

  change(value) {
    if (!this.begun) this.waiting = { ...this.waiting, ...value };
    if (this.end || !this.begun) return Promise.resolve();
    // A simulation that has just ended cannot be changed any more, and need not.
    return post("api/simulations/" + this.begun.id, value).catch((error) => { if (error.status !== 404) throw error; });
  }

  play(on) { this.playing = on; return this.change({ paused: !on }); }
  pace(speed) { this.speed = speed; return this.change({ speed }); }
  stop() { this.abort.abort(); }
  // The connection is lost: what has come is all there is.
  lose() { if (this.begun && !this.end) this.end = { step: this.last, answer: this.answer, unstable: null }; }
}
