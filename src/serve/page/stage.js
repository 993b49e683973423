// The robot on the ground, and what its sensors see. `Drawing`, a script of its own, is shared with the page that `replay` writes.

const { css, fit } = Drawing;

const NOWHERE = -32768;
// Side of the whole picture beside what the sensors see, pixels.
const WHOLE = 66;

export class Stage {
  constructor(canvas, materials) { this.canvas = canvas; this.materials = materials; this.camera = null; this.simulation = null; }

  prepare(simulation) {
    this.simulation = simulation; this.sides = Drawing.sidesOf(simulation.begun.voxels, simulation.begun.points); this.camera = null;
    this.room = new Drawing.Room(this.places(simulation, 0), simulation.moments[0].x);
  }

  // Points in voxel lengths; null where the simulation had lost one.
  places(simulation, frame) {
    const { x, y, points } = simulation.moments[frame], unit = simulation.begun.unit;
    return Array.from({ length: simulation.begun.points }, (_, i) =>
      points[2 * i] === NOWHERE ? null : [points[2 * i] / unit + x, points[2 * i + 1] / unit + y]);
  }

  draw(simulation, answer) {
    const canvas = this.canvas, { clientWidth: width, clientHeight: height } = canvas.parentElement, groundHeight = 30;
    const phone = width < 480;
    const ctx = fit(canvas, width, height), surface = height - groundHeight;
    const ready = simulation && simulation.begun && simulation.moments.length;
    if (ready && this.simulation !== simulation) this.prepare(simulation);
    const frame = ready ? simulation.frame : 0;
    const at = ready ? simulation.moments[frame].x : 0, zero = ready ? simulation.moments[0].x : 0;
    const body = ready ? this.room.take(this.places(simulation, frame), at) : null;
    const shown = ready ? (phone ? 1.25 * this.room.size + 11 : 1.5 * this.room.size + 14) : 40;
    const scale = Math.min(width / shown, (surface - 30) / (ready ? 1.1 * this.room.tall : 10), 36);
    // The camera stands until the robot nears the edge.
    this.camera = !ready || frame === 0 ? at : Drawing.camera(this.camera ?? at, body, width / scale, 3);
    const x0 = this.camera - width / 2 / scale;
    const X = (x) => Math.min(Math.max((x - x0) * scale, -9999), 9999);
    const Y = (y) => Math.min(Math.max(surface - y * scale, -9999), 9999);
    ctx.fillStyle = css("sky"); ctx.fillRect(0, 0, width, height);
    const begin = ready ? simulation.moments[Math.min(simulation.phase(frame).step, simulation.last)].x : 0;
    if (ready) this.signs(ctx, simulation, answer, X(begin), scale, width, surface);
    ctx.fillStyle = css("ground"); ctx.fillRect(0, surface, width, groundHeight);
    Drawing.ruler(ctx, { x0, zero, X, scale, width, surface });
    if (!ready) return;
    this.robot(ctx, simulation, frame, { X, Y, scale });
    Drawing.path(ctx, simulation.moments.slice(0, frame + 1).map(({ x, y }) => [x, y]), { X, Y });
  }

  // Which way means what: the classes on both sides of the strip in which a walk says nothing.
  signs(ctx, simulation, answer, begin, scale, width, surface) {
    const { judge, threshold, class_names } = simulation.begun, { side } = Drawing.classNames(class_names), reach = threshold * scale;
    ctx.strokeStyle = css("mark"); ctx.lineWidth = 1;
    for (const [x, dash] of [[begin, [5, 5]], [begin - reach, [1, 4]], [begin + reach, [1, 4]]]) {
      ctx.setLineDash(dash); ctx.beginPath(); ctx.moveTo(Math.round(x) + 0.5, 0); ctx.lineTo(Math.round(x) + 0.5, surface); ctx.stroke();
    }
    ctx.setLineDash([]);
    if (!judge) return;
    ctx.textBaseline = "top";
    for (const way of ["left", "right"]) {
      const on = answer && answer.way === way, right = way === "right", classes = judge[way];
      let count = classes.length;
      const text = () => side(classes.slice(0, count)) + (count < classes.length ? " …" : "");
      ctx.fillStyle = css(on ? "accent" : "mark");
      ctx.textAlign = right ? "right" : "left";
      let size = text().length > 3 ? 22 : 30;
      const font = () => { ctx.font = `700 ${size}px system-ui, sans-serif`; };
      font();
      // Of many classes, as many as fit beside those of the other side; a long name is small.
      const fits = () => ctx.measureText(text()).width <= width / 2 - 60;
      while (count > 1 && !fits()) count--;
      while (size > 12 && !fits()) { size--; font(); }
      ctx.fillText(right ? text() + " →" : "← " + text(), right ? width - 12 : 12, 8);
    }
  }

  robot(ctx, simulation, frame, view) {
    const { areas, list: materials } = this.materials, { voxels } = simulation.begun, points = this.places(simulation, frame);
    Drawing.robot(ctx, { voxels, points, sides: this.sides, areas, materials }, view);
    // Lit sensors.
    const { X, Y, scale } = view, { stimulus } = simulation.phase(frame);
    ctx.strokeStyle = css("lit"); ctx.lineWidth = Math.max(1.2, 0.13 * scale);
    for (const [material, corners, row, column] of voxels) {
      const light = materials[material].sensor ? stimulus[row][column] : 0, ends = corners.map((i) => points[i]);
      if (!(light > 0 && ends.every(Boolean))) continue;
      const middle = (axis) => ends.reduce((sum, q) => sum + q[axis], 0) / 4;
      ctx.globalAlpha = 0.25 + 0.75 * light;
      ctx.beginPath(); ctx.arc(X(middle(0)), Y(middle(1)), Math.max(1.2, 0.24 * scale), 0, 7); ctx.stroke();
    }
    ctx.globalAlpha = 1;
  }
}

// A stimulus with the body's sensors outlined; rows of the body as text.
export const drawStimulus = (canvas, stimulus, rows, materials) => {
  const space = canvas.parentElement.clientWidth, room = Math.min(space, 200, canvas.clientWidth || space);
  const grey = (r, c) => Math.round(255 * stimulus[r][c]);
  Drawing.stimulus(canvas, room, { height: stimulus.length, width: stimulus[0].length, grey }, rows, materials.list);
};

// The whole picture with the part framed that the sensors see; undefined if they see all of it.
export const drawWhole = (canvas, image) => {
  canvas.hidden = !image;
  if (!image) return;
  const { pixels, margin } = image;
  Drawing.framed(canvas, WHOLE, { height: pixels.length, width: pixels[0].length, grey: (r, c) => pixels[r][c], margin });
};

// A body at rest, one square per voxel.
export const drawBody = (canvas, rows, materials, size) => {
  const side = Math.max(rows.length, rows[0].length), ctx = fit(canvas, size, size), cell = size / side;
  ctx.clearRect(0, 0, size, size);
  const left = (side - rows[0].length) / 2, top = side - rows.length;
  const edge = (k) => Math.round(k * cell);
  rows.forEach((row, r) => [...row].forEach((m, c) => {
    if (Number(m) === 0) return;
    const [x, y] = [edge(c + left), edge(r + top)];
    Drawing.voxel(ctx, materials.list[Number(m)], [x, y], edge(c + left + 1) - x, edge(r + top + 1) - y);
  }));
};
