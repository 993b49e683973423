// The drawing: 28 × 28 pixels, strokes as soft-edged as MNIST's.

import { $ } from "./api.js";

const { css } = Drawing;
const SIDE = 28, RADIUS = 1.15;

export class Pad {
  // `changed(done)` is called with every change; `done` at the end of a stroke.
  constructor(canvas, changed) {
    this.canvas = canvas; this.changed = changed;
    this.ink = new Float64Array(SIDE * SIDE); this.before = []; this.erasing = false;
    this.cursor = null; this.down = false; this.drawing = null;
    canvas.addEventListener("pointerdown", (e) => this.begin(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => this.finish());
    canvas.addEventListener("keydown", (e) => this.key(e));
    canvas.addEventListener("focus", () => this.draw());
    canvas.addEventListener("blur", () => { this.cursor = null; this.lift(); this.draw(); });
    $("pen").onclick = () => this.erase(false);
    $("rubber").onclick = () => this.erase(true);
    $("undo").onclick = () => { if (this.before.length) { this.ink = this.before.pop(); this.changed(true); this.draw(); } };
    $("clear").onclick = () => { this.remember(); this.ink.fill(0); this.changed(true); this.draw(); };
    $("fit").onclick = () => { if (!this.empty) { this.remember(); this.fit(); this.changed(true); this.draw(); } };
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  // Rows of 0 (paper) … 255 (ink).
  get rows() {
    return Array.from({ length: SIDE }, (_, r) => Array.from(this.ink.slice(r * SIDE, (r + 1) * SIDE), (v) => Math.round(255 * v)));
  }
  get empty() { return this.ink.every((v) => v === 0); }

  erase(on) {
    this.erasing = on;
    $("pen").setAttribute("aria-pressed", String(!on));
    $("rubber").setAttribute("aria-pressed", String(on));
  }

  remember() { this.before.push(this.ink.slice()); if (this.before.length > 50) this.before.shift(); }

  place(e) {
    const box = this.canvas.getBoundingClientRect();
    return [(e.clientX - box.left) / box.width * SIDE, (e.clientY - box.top) / box.height * SIDE];
  }

  begin(e) {
    if (e.button > 0) return;
    e.preventDefault();
    this.canvas.focus({ preventScroll: true });
    try { this.canvas.setPointerCapture(e.pointerId); } catch { /* the pointer has gone already */ }
    this.remember(); this.cursor = null;
    this.drawing = this.place(e);
    this.stroke(this.drawing, this.drawing);
  }

  move(e) {
    if (!this.drawing) return;
    for (const each of e.getCoalescedEvents?.().length ? e.getCoalescedEvents() : [e]) {
      const to = this.place(each);
      this.stroke(this.drawing, to);
      this.drawing = to;
    }
  }

  finish() { if (this.drawing) { this.drawing = null; this.changed(true); } }

  // Ink where the line is nearer than the pen's radius, fading over a pixel.
  stroke([ax, ay], [bx, by]) {
    const dx = bx - ax, dy = by - ay, long = dx * dx + dy * dy, wide = this.erasing ? 2 * RADIUS : RADIUS;
    for (let r = 0; r < SIDE; r++) for (let c = 0; c < SIDE; c++) {
      const x = c + 0.5 - ax, y = r + 0.5 - ay;
      const t = long > 0 ? Math.min(1, Math.max(0, (x * dx + y * dy) / long)) : 0;
      const value = Math.min(1, Math.max(0, wide + 0.5 - Math.hypot(x - t * dx, y - t * dy)));
      const at = r * SIDE + c;
      this.ink[at] = this.erasing ? Math.min(this.ink[at], 1 - value) : Math.max(this.ink[at], value);
    }
    this.changed(false);
    this.draw();
  }

  // As MNIST's digits were made: the longer side of the ink scaled to 20 pixels, its centre of mass put in the middle.
  fit() {
    const old = this.ink, all = [...old.keys()].filter((k) => old[k] > 0);
    const xs = all.map((k) => k % SIDE), ys = all.map((k) => Math.floor(k / SIDE));
    const long = Math.max(Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys)) + 1;
    const mass = all.reduce((sum, k) => sum + old[k], 0), mean = (of) => all.reduce((sum, k, i) => sum + old[k] * of[i], 0) / mass;
    const [cx, cy, scale] = [mean(xs), mean(ys), 20 / long];
    const at = (r, c) => (r < 0 || c < 0 || r >= SIDE || c >= SIDE ? 0 : old[r * SIDE + c]);
    this.ink = old.map((_, k) => {
      const x = (k % SIDE + 0.5 - SIDE / 2) / scale + cx, y = (Math.floor(k / SIDE) + 0.5 - SIDE / 2) / scale + cy;
      const [c, r] = [Math.floor(x), Math.floor(y)], [u, v] = [x - c, y - r];
      const value = (1 - v) * ((1 - u) * at(r, c) + u * at(r, c + 1)) + v * ((1 - u) * at(r + 1, c) + u * at(r + 1, c + 1));
      // Enlarged, edges would be wide; they stay a pixel's.
      return Math.min(1, Math.max(0, 0.5 + (value - 0.5) * Math.max(1, scale)));
    });
  }

  lift() { if (this.down) { this.down = false; this.changed(true); } }

  key(e) {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
    const from = this.cursor ?? [SIDE / 2, SIDE / 2];
    if (by) {
      this.cursor = from.map((v, k) => Math.min(SIDE - 0.5, Math.max(0.5, v + by[k])));
      if (this.down) this.stroke(from, this.cursor);
    } else if (e.key === " ") {
      this.cursor = from;
      if (this.down) this.lift();
      else { this.down = true; this.remember(); this.stroke(from, from); }
    } else if (e.key === "Delete" || e.key === "Backspace") $("clear").click();
    else return;
    e.preventDefault(); e.stopPropagation();
    this.draw();
  }

  draw() {
    const canvas = this.canvas, size = Math.round((canvas.clientWidth || 280) * Math.min(devicePixelRatio || 1, 2));
    if (canvas.width !== size) { canvas.width = size; canvas.height = size; }
    const ctx = canvas.getContext("2d"), cell = size / SIDE, edge = (k) => Math.round(k * cell);
    ctx.fillStyle = css("paper"); ctx.fillRect(0, 0, size, size);
    ctx.fillStyle = css("pixel-line");
    for (let k = 2; k < SIDE; k += 2) { ctx.fillRect(edge(k), 0, 1, size); ctx.fillRect(0, edge(k), size, 1); }
    ctx.fillStyle = css("ink");
    for (let r = 0; r < SIDE; r++) for (let c = 0; c < SIDE; c++) {
      const v = this.ink[r * SIDE + c];
      if (v <= 0) continue;
      ctx.globalAlpha = v;
      ctx.fillRect(edge(c), edge(r), edge(c + 1) - edge(c), edge(r + 1) - edge(r));
    }
    ctx.globalAlpha = 1;
    if (this.empty) {
      ctx.fillStyle = css("faint"); ctx.textAlign = "center"; ctx.textBaseline = "middle";
      ctx.font = `${Math.round(size / 17)}px system-ui, sans-serif`;
      ctx.fillText("draw here", size / 2, size / 2);
    }
    if (this.cursor) {
      ctx.strokeStyle = css("accent"); ctx.lineWidth = this.down ? cell / 2 : cell / 4;
      ctx.beginPath(); ctx.arc(this.cursor[0] * cell, this.cursor[1] * cell, 1.4 * cell, 0, 7); ctx.stroke();
    }
  }
}
