"use strict";
// What the replay's page and that of `serve` draw alike: canvases, the ground, the robot, what it sees.
// `X` and `Y` take voxel lengths to pixels, `scale` is pixels per voxel length.
const Drawing = (() => {
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();

  // A canvas of sharp pixels; returns its context in CSS pixels.
  const fit = (canvas, width, height) => {
    const ratio = Math.min(window.devicePixelRatio || 1, 3);
    const w = Math.max(1, Math.round(width * ratio)), h = Math.max(1, Math.round(height * ratio));
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    canvas.style.height = height + "px";
    const ctx = canvas.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    return ctx;
  };

  // A material's colour at an area [voxels]: dark when shrunk, light when swollen.
  const shade = ([a, b, c], [dark, rest, light], area) => {
    const [from, to, t] = area < b ? [dark, rest, (area - a) / (b - a)] : [rest, light, (area - b) / (c - b)];
    const u = Math.min(Math.max(t, 0), 1);
    return from.map((v, k) => Math.round(v + u * (to[k] - v)));
  };
  const rgb = (colour) => `rgb(${colour.join(",")})`;

  // A material's mark in a voxel of some colour; its corners in pixels, clockwise from the top left. In small voxels it is as
  // large as elsewhere, 4 of 10 pixels; smaller yet, it would be a speck.
  const MARKED = 5;
  const onto = (tones, [r, g, b]) => (0.2126 * r + 0.7152 * g + 0.0722 * b > 105 ? tones[0].map((v) => v >> 1) : tones[2].map((v) => 128 + (v >> 1)));
  const mark = (ctx, { tones, mark: lines }, [a, b, c, d], fill, scale) => {
    if (!lines.length || scale < MARKED) return;
    const larger = Math.max(1, 10 / scale);
    const place = ([x, y]) => [0, 1].map((k) => (a[k] + b[k] + c[k] + d[k]) / 4 + larger * (x * (b[k] + c[k] - a[k] - d[k]) + y * (a[k] + b[k] - c[k] - d[k])) / 2);
    ctx.strokeStyle = rgb(onto(tones, fill));
    ctx.lineWidth = Math.max(1, 0.09 * scale);
    ctx.beginPath();
    for (const line of lines) line.forEach((point, k) => ctx[k ? "lineTo" : "moveTo"](...place(point)));
    ctx.stroke();
  };
  // A voxel of a body at rest.
  const voxel = (ctx, material, [x, y], width, height) => {
    const fill = material.tones[1];
    ctx.fillStyle = rgb(fill); ctx.fillRect(x, y, width, height);
    mark(ctx, material, [[x, y], [x + width, y], [x + width, y + height], [x, y + height]], fill, width);
  };

  // How many voxels each side belongs to; a side's key is made of its two points, of `count` in all.
  const sidesOf = (voxels, count) => {
    const sides = new Map();
    for (const [, c] of voxels) for (let k = 0; k < 4; k++) {
      const a = Math.min(c[k], c[(k + 1) % 4]), b = Math.max(c[k], c[(k + 1) % 4]), key = a * count + b;
      sides.set(key, (sides.get(key) || 0) + 1);
    }
    return sides;
  };

  // The ground's surface with a mark per voxel length, counted from `zero`; `x0` is at the left edge.
  const ruler = (ctx, { x0, zero, X, scale, width, surface }) => {
    ctx.strokeStyle = css("ground-line"); ctx.fillStyle = css("faint");
    ctx.font = "11px system-ui, sans-serif"; ctx.textAlign = "center"; ctx.textBaseline = "top";
    const by = scale * 10 > 45 ? 10 : 50;
    for (let m = Math.ceil(x0 - zero); m <= x0 - zero + width / scale; m++) {
      const ten = m % 10 === 0;
      if (!ten && scale < 4) continue;
      ctx.lineWidth = ten ? 1.5 : 1;
      ctx.beginPath(); ctx.moveTo(X(zero + m), surface); ctx.lineTo(X(zero + m), surface + (ten ? 9 : 4)); ctx.stroke();
      // A number that would be cut off at the edge is left out.
      if (m % by === 0 && X(zero + m) > 16 && X(zero + m) < width - 16) ctx.fillText(m === 0 ? "0" : (m < 0 ? "−" : "+") + Math.abs(m), X(zero + m), surface + 13);
    }
    ctx.lineWidth = 1.5; ctx.beginPath(); ctx.moveTo(0, surface); ctx.lineTo(width, surface); ctx.stroke();
  };

  // An object of fixed cells, where it is seen: its cells, the lines between them, and its outline.
  const terrain = (ctx, { column, row, grid }, seen, { X, Y, scale }) => {
    const isFixed = (x, y) => (grid[row + grid.length - 1 - y] || "")[x - column] === "5";
    const within = (first, count, [low, high]) => [Math.max(first, Math.floor(low)), Math.min(first + count, Math.ceil(high))];
    const [left, right] = within(column, grid[0].length, seen.columns), [low, high] = within(row, grid.length, seen.rows);
    const lines = { sky: [], "ground-line": [] };
    ctx.fillStyle = css("ground");
    for (let y = low; y < high; y++) for (let x = left; x < right; x++) if (isFixed(x, y)) {
      ctx.fillRect(X(x), Y(y + 1), X(x + 1) - X(x), Y(y) - Y(y + 1));
      for (const [dx, dy, ...side] of [[0, 1, x, y + 1, x + 1, y + 1], [1, 0, x + 1, y + 1, x + 1, y], [0, -1, x, y, x + 1, y], [-1, 0, x, y + 1, x, y]]) {
        lines[isFixed(x + dx, y + dy) ? "sky" : "ground-line"].push(side);
      }
    }
    for (const [colour, sides] of Object.entries(lines)) {
      if (colour === "sky" && scale < MARKED) continue;
      ctx.strokeStyle = css(colour); ctx.lineWidth = colour === "sky" ? 1 : 1.5; ctx.beginPath();
      for (const [a, b, c, d] of sides) { ctx.moveTo(X(a), Y(b)); ctx.lineTo(X(c), Y(d)); }
      ctx.stroke();
    }
  };

  // A body: voxels [material, corners, …], its points (null where the simulation had lost one), and its sides.
  const robot = (ctx, { voxels, points, sides, areas, materials }, { X, Y, scale }) => {
    ctx.lineJoin = ctx.lineCap = "round";
    for (const [material, corners] of voxels) {
      const [a, b, c, d] = corners.map((i) => points[i]);
      if (!(a && b && c && d)) continue;
      const area = ((c[0] - a[0]) * (b[1] - d[1]) - (b[0] - d[0]) * (c[1] - a[1])) / 2;
      const fill = shade(areas, materials[material].tones, area), at = [a, b, c, d].map((q) => [X(q[0]), Y(q[1])]);
      ctx.fillStyle = ctx.strokeStyle = rgb(fill);
      ctx.lineWidth = 0.6;
      ctx.beginPath();
      for (const q of at) ctx.lineTo(...q);
      ctx.closePath(); ctx.fill(); ctx.stroke();
      mark(ctx, materials[material], at, fill, scale);
    }
    for (const outer of [false, true]) {
      if (!outer && scale < 5) continue;
      ctx.strokeStyle = css(outer ? "rim" : "seam"); ctx.lineWidth = outer ? 1.4 : 1;
      ctx.beginPath();
      for (const [key, count] of sides) if ((count === 1) === outer) {
        const a = points[Math.floor(key / points.length)], b = points[key % points.length];
        if (a && b) { ctx.moveTo(X(a[0]), Y(a[1])); ctx.lineTo(X(b[0]), Y(b[1])); }
      }
      ctx.stroke();
    }
  };

  // The room that a body takes in the picture. It grows with a body that stretches or jumps, up
  // to twice its first size: parts that are flung off do not count.
  class Room {
    constructor(points, x) {
      const { left, right, top } = extent(points);
      this.most = { size: 2 * Math.max(1, right - left), tall: 2 * Math.max(1, top) };
      this.size = this.most.size / 2; this.tall = this.most.tall / 2;
      this.take(points, x);
    }

    // Left and right edge of the body with its centre of mass at `x`; makes room for it.
    take(points, x) {
      const { left, right, top } = extent(points), far = this.most.size / 2;
      const body = { left: Math.max(left, x - far), right: Math.min(right, x + far) };
      this.size = Math.min(Math.max(this.size, body.right - body.left), this.most.size);
      this.tall = Math.min(Math.max(this.tall, top), this.most.tall);
      return body;
    }
  }

  // The middle of a picture, `wide` voxel lengths, moved from `middle` as little as keeps a body and a margin in it.
  const camera = (middle, { left, right }, wide, margin) => {
    const low = right + margin - wide / 2, high = left - margin + wide / 2;
    return low > high ? (left + right) / 2 : Math.min(Math.max(middle, low), high);
  };

  // Left, right, upper and lower edge of some points; null are not known.
  const extent = (points) => {
    let left = Infinity, right = -Infinity, top = 0, bottom = Infinity;
    for (const q of points) if (q) { left = Math.min(left, q[0]); right = Math.max(right, q[0]); top = Math.max(top, q[1]); bottom = Math.min(bottom, q[1]); }
    return left > right ? { left: 0, right: 0, top, bottom: 0 } : { left, right, top, bottom };
  };

  // The way of the centre of mass, and where it is now.
  const path = (ctx, places, { X, Y }) => {
    for (const [colour, line] of [["halo", 4], ["accent", 1.8]]) {
      ctx.strokeStyle = css(colour); ctx.lineWidth = line; ctx.beginPath();
      for (const [x, y] of places) ctx.lineTo(X(x), Y(y));
      ctx.stroke();
    }
    const [x, y] = places[places.length - 1];
    ctx.fillStyle = css("accent"); ctx.strokeStyle = css("sky"); ctx.lineWidth = 1.5;
    ctx.beginPath(); ctx.arc(X(x), Y(y), 4.5, 0, 7); ctx.fill(); ctx.stroke();
  };

  // A stimulus `room` pixels wide, grey levels 0 to 255 by row and column, with the sensors of the body (rows of text) outlined.
  const stimulus = (canvas, room, { height, width, grey }, rows, materials) => {
    const cell = room / Math.max(height, width), ctx = fit(canvas, room, cell * height);
    ctx.clearRect(0, 0, room, cell * height);
    const edge = (k) => Math.round(k * cell);
    const material = (r, c) => (rows[r] && rows[r][c] ? Number(rows[r][c]) : 0);
    for (let r = 0; r < height; r++) for (let c = 0; c < width; c++) {
      const v = grey(r, c);
      ctx.fillStyle = `rgb(${v},${v},${v})`;
      ctx.fillRect(edge(c), edge(r), edge(c + 1) - edge(c), edge(r + 1) - edge(r));
    }
    ctx.lineWidth = Math.max(1, Math.min(2.5, cell / 4));
    const h = ctx.lineWidth / 2;
    for (let r = 0; r < height; r++) for (let c = 0; c < width; c++) {
      const m = material(r, c);
      if (!materials[m].sensor) continue;
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

  // The frame around the part of a picture that the sensors see; `margin`: what they do not see at the top, right, bottom and left,
  // in pixels of the page. Its yellow shows on black as on white.
  const frame = (ctx, [top, right, bottom, left], [x, y, width, height]) => {
    ctx.lineWidth = 2; ctx.strokeStyle = "#ffb000";
    ctx.strokeRect(x + left + 1, y + top + 1, width - left - right - 2, height - top - bottom - 2);
  };

  // A picture of grey levels 0 to 255, `room` pixels wide at most, with the part that the sensors see framed.
  const framed = (canvas, room, { height, width, grey, margin }) => {
    const cell = room / Math.max(height, width), ctx = fit(canvas, cell * width, cell * height), edge = (k) => Math.round(k * cell);
    canvas.style.width = cell * width + "px";
    for (let r = 0; r < height; r++) for (let c = 0; c < width; c++) {
      const v = grey(r, c);
      ctx.fillStyle = `rgb(${v},${v},${v})`;
      ctx.fillRect(edge(c), edge(r), edge(c + 1) - edge(c), edge(r + 1) - edge(r));
    }
    frame(ctx, margin.map(edge), [0, 0, edge(width), edge(height)]);
  };

  // A material's colours (small, at rest, large) with its mark, for a legend.
  const swatch = ({ tones, mark: lines }, shown = [0, 1, 2]) => {
    const made = document.createElement("span"), middle = shown.indexOf(1);
    const boxes = shown.map((tone, k) => `<rect x="${14 * k}" width="14" height="14" fill="${rgb(tones[tone])}"/>`).join("");
    const d = lines.map((line) => "M" + line.map(([x, y]) => `${14 * middle + 7 + 14 * x} ${7 - 14 * y}`).join("L")).join("");
    made.innerHTML = `<svg width="${14 * shown.length}" height="14" aria-hidden="true">${boxes}<path d="${d}" fill="none" stroke="${rgb(onto(tones, tones[1]))}" stroke-width="1.6"/></svg>`;
    return made.firstChild;
  };

  // A new element.
  const element = (tag, properties = {}, ...children) => {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  };

  // Names of classes as class_names.rs has them: of one, of one in a sentence, and of a side; `given` begins with class 0 and may lack some, or all.
  const classNames = (given) => {
    const name = (label) => given?.[label] || String(label);
    const a = (label) => given?.[label] || "a " + label;
    return { name, a, side: (labels) => labels.map(name).join(labels.some((label) => given?.[label]) ? ", " : " ") };
  };

  return { camera, classNames, css, element, extent, fit, frame, framed, sidesOf, ruler, terrain, robot, voxel, swatch, path, stimulus, Room };
})();
