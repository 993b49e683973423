// Drawing: the robot on the ground, and what its sensors see. The looks are those of the page that `replay` writes.

import { css, fit } from "./api.js";

const NOWHERE = -32768;

export class Stage {
  constructor(canvas, materials) { this.canvas = canvas; this.materials = materials; this.camera = null; this.life = null; }

  shade(material, area) {
    const [a, b, c] = this.materials.areas, [dark, rest, light] = this.materials.list[material].tones;
    const [from, to, t] = area < b ? [dark, rest, (area - a) / (b - a)] : [rest, light, (area - b) / (c - b)];
    const u = Math.min(Math.max(t, 0), 1);
    return "rgb(" + from.map((v, k) => Math.round(v + u * (to[k] - v))).join(",") + ")";
  }

  // What stays the same all through a life.
  prepare(life) {
    const P = life.begun.points, sides = new Map();
    for (const [, c] of life.begun.voxels) for (let k = 0; k < 4; k++) {
      const a = Math.min(c[k], c[(k + 1) % 4]), b = Math.max(c[k], c[(k + 1) % 4]), key = a * P + b;
      sides.set(key, (sides.get(key) || 0) + 1);
    }
    const first = this.places(life, 0);
    let size = 1, top = 1;
    for (const q of first) { size = Math.max(size, 2 * Math.abs(q[0] - life.moments[0].x)); top = Math.max(top, q[1]); }
    this.life = life; this.sides = sides; this.size = size; this.tall = top; this.camera = null;
  }

  // Points in voxel lengths; null where the simulation had lost one.
  places(life, frame) {
    const { x, y, points } = life.moments[frame], unit = life.begun.unit;
    return Array.from({ length: life.begun.points }, (_, i) =>
      points[2 * i] === NOWHERE ? null : [points[2 * i] / unit + x, points[2 * i + 1] / unit + y]);
  }

  draw(life, answer) {
    const canvas = this.canvas, { clientWidth: width, clientHeight: height } = canvas.parentElement, groundHeight = 30;
    const phone = width < 480;
    const ctx = fit(canvas, width, height), surface = height - groundHeight;
    const ready = life && life.begun && life.moments.length;
    if (ready && this.life !== life) this.prepare(life);
    const shown = ready ? (phone ? 1.25 * this.size + 11 : 1.9 * this.size + 12) : 40;
    const scale = Math.min(width / shown, (surface - 30) / (ready ? 1.22 * this.tall : 10), 36);
    const frame = ready ? life.frame : 0;
    const at = ready ? life.moments[frame].x : 0, zero = ready ? life.moments[0].x : 0;
    // The camera stands until the robot nears the edge.
    const room = Math.max(0, width / scale / 2 - this.size / 2 - 4);
    const from = this.camera ?? at, camera = Math.min(Math.max(from, at - room), at + room);
    this.camera = frame === 0 ? at : camera;
    const x0 = this.camera - width / 2 / scale;
    const X = (x) => Math.min(Math.max((x - x0) * scale, -9999), 9999);
    const Y = (y) => Math.min(Math.max(surface - y * scale, -9999), 9999);
    ctx.fillStyle = css("sky"); ctx.fillRect(0, 0, width, height);
    const begin = ready ? life.moments[Math.min(life.phase(frame).step, life.last)].x : 0;
    if (ready) this.signs(ctx, life, answer, X(begin), scale, width, surface);
    ctx.fillStyle = css("ground"); ctx.fillRect(0, surface, width, groundHeight);
    this.ruler(ctx, x0, zero, X, scale, width, surface);
    if (!ready) return;
    this.robot(ctx, life, frame, X, Y, scale);
    this.path(ctx, life, frame, X, Y);
  }

  // Which way means what: the classes on both sides of the strip in which a walk says nothing.
  signs(ctx, life, answer, begin, scale, width, surface) {
    const { judge, threshold } = life.begun, reach = threshold * scale;
    ctx.strokeStyle = css("mark"); ctx.lineWidth = 1;
    for (const [x, dash] of [[begin, [5, 5]], [begin - reach, [1, 4]], [begin + reach, [1, 4]]]) {
      ctx.setLineDash(dash); ctx.beginPath(); ctx.moveTo(Math.round(x) + 0.5, 0); ctx.lineTo(Math.round(x) + 0.5, surface); ctx.stroke();
    }
    ctx.setLineDash([]);
    if (!judge) return;
    const text = (way) => judge[way].join(" ");
    ctx.textBaseline = "top";
    for (const way of ["left", "right"]) {
      const on = answer && answer.way === way, right = way === "right";
      ctx.fillStyle = css(on ? "accent" : "mark");
      ctx.textAlign = right ? "right" : "left";
      ctx.font = "700 " + (text(way).length > 3 ? 22 : 30) + "px system-ui, sans-serif";
      ctx.fillText(right ? text(way) + " →" : "← " + text(way), right ? width - 12 : 12, 8);
    }
  }

  ruler(ctx, x0, zero, X, scale, width, surface) {
    ctx.strokeStyle = css("ground-line"); ctx.fillStyle = css("faint");
    ctx.font = "11px system-ui, sans-serif"; ctx.textAlign = "center"; ctx.textBaseline = "top";
    const by = scale * 10 > 45 ? 10 : 50;
    for (let m = Math.ceil(x0 - zero); m <= x0 - zero + width / scale; m++) {
      const ten = m % 10 === 0;
      if (!ten && scale < 4) continue;
      ctx.lineWidth = ten ? 1.5 : 1;
      ctx.beginPath(); ctx.moveTo(X(zero + m), surface); ctx.lineTo(X(zero + m), surface + (ten ? 9 : 4)); ctx.stroke();
      if (m % by === 0) ctx.fillText(m === 0 ? "0" : (m < 0 ? "−" : "+") + Math.abs(m), X(zero + m), surface + 13);
    }
    ctx.lineWidth = 1.5; ctx.beginPath(); ctx.moveTo(0, surface); ctx.lineTo(width, surface); ctx.stroke();
  }

  robot(ctx, life, frame, X, Y, scale) {
    const points = this.places(life, frame), P = life.begun.points, { stimulus } = life.phase(frame);
    const lit = [];
    ctx.lineJoin = ctx.lineCap = "round";
    for (const [material, corners, row, column] of life.begun.voxels) {
      const [a, b, c, d] = corners.map((i) => points[i]);
      if (!(a && b && c && d)) continue;
      const area = ((c[0] - a[0]) * (b[1] - d[1]) - (b[0] - d[0]) * (c[1] - a[1])) / 2;
      ctx.fillStyle = ctx.strokeStyle = this.shade(material, area);
      ctx.lineWidth = 0.6;
      ctx.beginPath();
      for (const q of [a, b, c, d]) ctx.lineTo(X(q[0]), Y(q[1]));
      ctx.closePath(); ctx.fill(); ctx.stroke();
      const light = this.materials.list[material].sensor ? stimulus[row][column] : 0;
      if (light > 0) lit.push([light, (a[0] + b[0] + c[0] + d[0]) / 4, (a[1] + b[1] + c[1] + d[1]) / 4]);
    }
    for (const outer of [false, true]) {
      if (!outer && scale < 5) continue;
      ctx.strokeStyle = css(outer ? "rim" : "seam"); ctx.lineWidth = outer ? 1.4 : 1;
      ctx.beginPath();
      for (const [key, count] of this.sides) if ((count === 1) === outer) {
        const a = points[Math.floor(key / P)], b = points[key % P];
        if (a && b) { ctx.moveTo(X(a[0]), Y(a[1])); ctx.lineTo(X(b[0]), Y(b[1])); }
      }
      ctx.stroke();
    }
    // Lit sensors.
    ctx.strokeStyle = css("lit"); ctx.lineWidth = Math.max(1.2, 0.13 * scale);
    for (const [light, x, y] of lit) {
      ctx.globalAlpha = 0.25 + 0.75 * light;
      ctx.beginPath(); ctx.arc(X(x), Y(y), Math.max(1.2, 0.24 * scale), 0, 7); ctx.stroke();
    }
    ctx.globalAlpha = 1;
  }

  path(ctx, life, frame, X, Y) {
    for (const [colour, line] of [["halo", 4], ["accent", 1.8]]) {
      ctx.strokeStyle = css(colour); ctx.lineWidth = line; ctx.beginPath();
      for (let f = 0; f <= frame; f++) ctx.lineTo(X(life.moments[f].x), Y(life.moments[f].y));
      ctx.stroke();
    }
    const { x, y } = life.moments[frame];
    ctx.fillStyle = css("accent"); ctx.strokeStyle = css("sky"); ctx.lineWidth = 1.5;
    ctx.beginPath(); ctx.arc(X(x), Y(y), 4.5, 0, 7); ctx.fill(); ctx.stroke();
  }
}

// A stimulus with the body's sensors outlined; rows of the body as text.
export const drawStimulus = (canvas, stimulus, rows, materials) => {
  const height = stimulus.length, width = stimulus[0].length, space = canvas.parentElement.clientWidth;
  const room = Math.min(space, 200, canvas.clientWidth || space), cell = room / Math.max(height, width);
  const ctx = fit(canvas, room, cell * height);
  ctx.clearRect(0, 0, room, cell * height);
  const edge = (k) => Math.round(k * cell);
  const material = (r, c) => (rows[r] && rows[r][c] ? Number(rows[r][c]) : 0);
  stimulus.forEach((line, r) => line.forEach((value, c) => {
    const v = Math.round(255 * value);
    ctx.fillStyle = `rgb(${v},${v},${v})`;
    ctx.fillRect(edge(c), edge(r), edge(c + 1) - edge(c), edge(r + 1) - edge(r));
  }));
  ctx.lineWidth = Math.max(1, Math.min(2.5, cell / 4));
  const h = ctx.lineWidth / 2;
  for (let r = 0; r < height; r++) for (let c = 0; c < width; c++) {
    const m = material(r, c);
    if (!materials.list[m].sensor) continue;
    ctx.strokeStyle = m === 5 ? "#f03e52" : "#26ba78";
    const [l, t, R, b] = [edge(c) + h, edge(r) + h, edge(c + 1) - h, edge(r + 1) - h];
    ctx.beginPath();
    if (material(r - 1, c) !== m) { ctx.moveTo(l - h, t); ctx.lineTo(R + h, t); }
    if (material(r + 1, c) !== m) { ctx.moveTo(l - h, b); ctx.lineTo(R + h, b); }
    if (material(r, c - 1) !== m) { ctx.moveTo(l, t - h); ctx.lineTo(l, b + h); }
    if (material(r, c + 1) !== m) { ctx.moveTo(R, t - h); ctx.lineTo(R, b + h); }
    ctx.stroke();
  }
};

// A body at rest, one square per voxel.
export const drawBody = (canvas, rows, materials, size) => {
  const side = Math.max(rows.length, rows[0].length), ctx = fit(canvas, size, size), cell = size / side;
  ctx.clearRect(0, 0, size, size);
  const left = (side - rows[0].length) / 2, top = side - rows.length;
  const edge = (k) => Math.round(k * cell);
  rows.forEach((row, r) => [...row].forEach((m, c) => {
    if (Number(m) === 0) return;
    ctx.fillStyle = `rgb(${materials.list[Number(m)].tones[1].join(",")})`;
    ctx.fillRect(edge(c + left), edge(r + top), edge(c + left + 1) - edge(c + left), edge(r + top + 1) - edge(r + top));
  }));
};
