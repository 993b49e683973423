// The drawing: 28 × 28 pixels, strokes as soft-edged as MNIST's.

import { $, liftedElsewhere } from "./api.js";

const { css } = Drawing;
const SIDE = 28, RADIUS = 1.15;
// MNIST's digits fill a box of 20 × 20 pixels. A dot is not blown up to that size.
const BOX = 20, MOST = 6;

// Ink where a line is nearer than the pen's radius, fading over a pixel.
const mark = (ink, [ax, ay], [bx, by], erasing, scale = 1) => {
  const dx = bx - ax, dy = by - ay, long = dx * dx + dy * dy, wide = erasing ? 2 * RADIUS * scale : RADIUS;
  for (let r = 0; r < SIDE; r++) for (let c = 0; c < SIDE; c++) {
    const x = c + 0.5 - ax, y = r + 0.5 - ay;
    const t = long > 0 ? Math.min(1, Math.max(0, (x * dx + y * dy) / long)) : 0;
    const value = Math.min(1, Math.max(0, wide + 0.5 - Math.hypot(x - t * dx, y - t * dy)));
    const at = r * SIDE + c;
    ink[at] = erasing ? Math.min(ink[at], 1 - value) : Math.max(ink[at], value);
  }
};

// Strokes, moved and scaled about a point; the pen stays as wide as it is, the eraser takes away what it took.
const render = (strokes, [cx, cy], scale) => {
  const ink = new Float64Array(SIDE * SIDE), to = ([x, y]) => [(x - cx) * scale + SIDE / 2, (y - cy) * scale + SIDE / 2];
  for (const { erasing, points } of strokes) points.forEach((point, k) => mark(ink, to(points[Math.max(0, k - 1)]), to(point), erasing, scale));
  return ink;
};

// As MNIST's digits were made: the longer side 20 pixels, the centre of mass in the middle of 28 × 28.
const fitted = (strokes, ink) => {
  const all = [...ink.keys()].filter((k) => ink[k] > 0.5);
  if (!all.length) return ink;
  const xs = all.map((k) => k % SIDE), ys = all.map((k) => Math.floor(k / SIDE)), pen = 2 * RADIUS;
  const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs) + 1, Math.min(...ys), Math.max(...ys) + 1];
  const scale = Math.min(MOST, (BOX - pen) / Math.max(right - left - pen, bottom - top - pen, 1)), middle = [(left + right) / 2, (top + bottom) / 2];
  const once = render(strokes, middle, scale), mass = once.reduce((sum, v) => sum + v, 0);
  if (!mass) return ink;
  const off = (of) => once.reduce((sum, v, k) => sum + v * (of(k) + 0.5 - SIDE / 2), 0) / mass / scale;
  return render(strokes, [middle[0] + off((k) => k % SIDE), middle[1] + off((k) => Math.floor(k / SIDE))], scale);
};

export class Pad {
  // `changed(done)` is called with every change; `done` at the end of a stroke.
  constructor(canvas, changed) {
    this.canvas = canvas; this.changed = changed;
    this.strokes = []; this.ink = new Float64Array(SIDE * SIDE); this.before = []; this.erasing = false;
    this.cursor = null; this.down = false; this.drawing = null;
    canvas.addEventListener("pointerdown", (e) => this.begin(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => { if (e.pointerId === this.pointer) this.finish(); });
    // A browser may take the pointer away while it is still down, as when the page moves under it: the stroke goes on.
    canvas.addEventListener("lostpointercapture", (e) => { if (this.drawing && e.pointerId === this.pointer) { if (e.buttons) this.hold(); else this.finish(); } });
    canvas.addEventListener("keydown", (e) => this.key(e));
    canvas.addEventListener("focus", () => this.draw());
    canvas.addEventListener("blur", () => { this.cursor = null; this.lift(); this.draw(); });
    $("pen").onclick = () => this.erase(false);
    $("rubber").onclick = () => this.erase(true);
    $("undo").onclick = () => { if (this.before.length) this.set(this.before.pop()); };
    $("clear").onclick = () => { this.remember(); this.set([]); };
    $("fit").onchange = () => { if (!this.empty) this.changed(true); };
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  // The drawing as it is shown to robots: rows of 0 (paper) … 255 (ink).
  get rows() {
    const ink = $("fit").checked ? fitted(this.strokes, this.ink) : this.ink;
    return Array.from({ length: SIDE }, (_, r) => Array.from(ink.slice(r * SIDE, (r + 1) * SIDE), (v) => Math.round(255 * v)));
  }
  get empty() { return this.ink.every((v) => v === 0); }

  erase(on) {
    this.erasing = on;
    $("pen").setAttribute("aria-pressed", String(!on));
    $("rubber").setAttribute("aria-pressed", String(on));
  }

  remember() {
    this.before.push(this.strokes.map(({ erasing, points }) => ({ erasing, points: [...points] })));
    if (this.before.length > 50) this.before.shift();
  }

  set(strokes) {
    this.strokes = strokes;
    this.ink = render(strokes, [SIDE / 2, SIDE / 2], 1);
    this.changed(true); this.draw();
  }

  place(e) {
    const box = this.canvas.getBoundingClientRect();
    return [(e.clientX - box.left) / box.width * SIDE, (e.clientY - box.top) / box.height * SIDE];
  }

  begin(e) {
    // A second finger draws nothing, nor does a palm beside a pen.
    if (e.button > 0 || this.drawing && (!e.isPrimary || this.kind === "pen" && e.pointerType === "touch")) return;
    this.pointer = e.pointerId; this.kind = e.pointerType;
    e.preventDefault();
    this.canvas.focus({ preventScroll: true });
    this.hold();
    this.remember(); this.cursor = null;
    this.drawing = this.place(e);
    this.stroke(this.drawing, this.drawing);
  }

  hold() { try { this.canvas.setPointerCapture(this.pointer); } catch { /* the pointer has gone already */ } }

  move(e) {
    if (!this.drawing || e.pointerId !== this.pointer) return;
    if (liftedElsewhere(e)) return this.finish();
    for (const each of e.getCoalescedEvents?.().length ? e.getCoalescedEvents() : [e]) {
      const to = this.place(each);
      this.stroke(this.drawing, to);
      this.drawing = to;
    }
  }

  finish() { if (this.drawing) { this.drawing = null; this.changed(true); } }

  // A line; one that begins where none has ended begins a stroke.
  stroke(from, to) {
    const last = this.strokes.at(-1), end = last?.points.at(-1);
    if (last && last.erasing === this.erasing && from !== to && end[0] === from[0] && end[1] === from[1]) last.points.push(to);
    else this.strokes.push({ erasing: this.erasing, points: from === to ? [to] : [from, to] });
    mark(this.ink, from, to, this.erasing);
    this.changed(false);
    this.draw();
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
