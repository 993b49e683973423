// The body editor: a grid of voxels, checked by the server, kept in files that `morphcog simulate` reads.

import { $, element, liftedElsewhere, post } from "./api.js";

const { css, fit } = Drawing;
const AREA = (encoding) => ({ reduction: "area", encoding, level: 0.2 });
// A small walker to begin with, evolved on digits in a minute: left under a zero, right under a one.
const FIRST = ["4444444", "4444445", "5444465", "5544465", "5544445", "5444444", "4444444"];

export class Editor {
  // `live(subject, steps)` is asked for a simulation, `see()` tells what the picture is now.
  constructor(materials, { live, see, say, chosen }) {
    Object.assign(this, { materials, live, say, see, material: 3, cursor: null, painting: null, before: [], stimulus: null, steps: 500 });
    this.cells = FIRST.map((row) => [...row].map(Number));
    this.encoding = AREA("threshold");
    const grid = $("grid");
    grid.addEventListener("pointerdown", (e) => this.begin(e));
    grid.addEventListener("pointermove", (e) => {
      if (liftedElsewhere(e)) this.painting = null;
      if (this.painting !== null) this.paint(this.at(e), this.painting);
    });
    for (const end of ["pointerup", "pointercancel"]) grid.addEventListener(end, () => { this.painting = null; });
    grid.addEventListener("contextmenu", (e) => e.preventDefault());
    grid.addEventListener("keydown", (e) => this.key(e));
    grid.addEventListener("blur", () => { this.cursor = null; this.draw(); });
    new ResizeObserver(() => this.draw()).observe(grid.parentElement);
    this.swatches();
    for (const id of ["rows", "columns"]) $(id).onchange = () => this.resize(Number($("rows").value), Number($("columns").value));
    $("pixels").onchange = () => { this.encoding = { ...this.encoding, encoding: $("pixels").value }; this.stimulus = null; this.changed(); };
    $("live").onclick = () => live();
    $("copy").onclick = () => { const from = chosen(); if (from) this.copy(from.robot, from.encoding); };
    $("mirror").onclick = () => this.set(this.cells.map((row) => [...row].reverse()));
    $("empty").onclick = () => this.set(this.cells.map((row) => row.map(() => 0)));
    $("unpaint").onclick = () => { if (this.before.length) { this.cells = this.before.pop(); this.fill(); this.changed(); } };
    $("save").onclick = () => this.save().catch(say);
    $("load").onclick = () => $("file").click();
    $("file").onchange = () => this.load().catch(say);
    this.fill(); this.changed();
  }

  get subject() { return { body: this.cells, encoding: this.encoding }; }

  swatches() {
    $("palette").replaceChildren(...this.materials.list.map((material, k) => {
      const swatch = k === 0 ? element("i") : Drawing.swatch(material, [1]), button = element("button", { type: "button" }, swatch, `${k} ${material.name}`);
      button.setAttribute("role", "radio");
      button.onclick = () => this.take(k);
      button.addEventListener("keydown", (e) => {
        const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[e.key];
        if (!by) return;
        this.take((k + by + 7) % 7); $("palette").children[this.material].focus();
        e.preventDefault(); e.stopPropagation();
      });
      return button;
    }));
    this.take(this.material);
  }

  take(material) {
    this.material = material;
    [...$("palette").children].forEach((button, k) => {
      button.setAttribute("aria-checked", String(k === material));
      button.tabIndex = k === material ? 0 : -1;
    });
  }

  fill() { $("rows").value = this.cells.length; $("columns").value = this.cells[0].length; }

  remember() { this.before.push(this.cells.map((row) => [...row])); if (this.before.length > 100) this.before.shift(); }

  set(cells) { this.remember(); this.cells = cells; this.fill(); this.changed(); }

  // What stood on the ground stays on it.
  resize(height, width) {
    const side = (value) => Math.min(32, Math.max(1, Math.round(value) || 1));
    const [h, w] = [side(height), side(width)], shift = this.cells.length - h;
    this.encoding = AREA(this.encoding.encoding); this.stimulus = null;
    this.set(Array.from({ length: h }, (_, r) => Array.from({ length: w }, (_, c) => this.cells[r + shift]?.[c] ?? 0)));
  }

  copy(robot, encoding) {
    this.encoding = { ...encoding }; this.stimulus = null;
    $("pixels").value = encoding.encoding;
    this.set(robot.body.map((row) => [...row]));
  }

  at(e) {
    const box = $("grid").getBoundingClientRect();
    return [Math.floor((e.clientY - box.top) / this.cell), Math.floor((e.clientX - box.left) / this.cell)];
  }

  begin(e) {
    e.preventDefault();
    $("grid").focus({ preventScroll: true });
    try { $("grid").setPointerCapture(e.pointerId); } catch { /* the pointer has gone already */ }
    this.cursor = null; this.remember();
    this.painting = e.button === 2 ? 0 : this.material;
    this.paint(this.at(e), this.painting);
  }

  paint([r, c], material) {
    if (this.cells[r]?.[c] === undefined || this.cells[r][c] === material) return;
    this.cells[r][c] = material;
    this.changed();
  }

  key(e) {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const by = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[e.key];
    const [r, c] = this.cursor ?? [this.cells.length - 1, 0];
    if (by) this.cursor = [Math.min(this.cells.length - 1, Math.max(0, r + by[0])), Math.min(this.cells[0].length - 1, Math.max(0, c + by[1]))];
    else if (/^[0-6]$/.test(e.key) || e.key === " ") {
      this.cursor = [r, c]; this.remember();
      this.paint(this.cursor, e.key === " " ? this.material : Number(e.key));
    } else return;
    e.preventDefault(); e.stopPropagation();
    this.draw();
  }

  // Drawn at once, checked when the hand rests.
  changed() {
    this.draw();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.check().catch(this.say), 120);
  }

  async check() {
    const checked = await post("api/body", { body: this.cells });
    const counts = `${checked.total} voxels: ${checked.muscle} muscle, ${checked.sensor} sensor`;
    $("checked").dataset.state = checked.problem ? "bad" : "good";
    $("checked").textContent = checked.problem ? `It cannot live: ${checked.problem}` : counts + (checked.note ? `; ${checked.note}` : "");
    $("live").disabled = $("save").disabled = Boolean(checked.problem);
  }

  draw() {
    const canvas = $("grid"), height = this.cells.length, width = this.cells[0].length;
    const room = canvas.parentElement.clientWidth;
    if (!room) return;
    this.cell = Math.min(room / width, 460 / height, 52);
    canvas.style.width = this.cell * width + "px";
    const ctx = fit(canvas, this.cell * width, this.cell * height), cell = this.cell;
    ctx.fillStyle = css("sky"); ctx.fillRect(0, 0, cell * width, cell * height);
    this.cells.forEach((row, r) => row.forEach((material, c) => {
      if (material === 0) return;
      Drawing.voxel(ctx, this.materials.list[material], [c * cell, r * cell], cell, cell);
    }));
    ctx.strokeStyle = css("line"); ctx.lineWidth = 1;
    ctx.beginPath();
    for (let r = 0; r <= height; r++) { ctx.moveTo(0, r * cell); ctx.lineTo(width * cell, r * cell); }
    for (let c = 0; c <= width; c++) { ctx.moveTo(c * cell, 0); ctx.lineTo(c * cell, height * cell); }
    ctx.stroke();
    ctx.strokeStyle = css("ground-line"); ctx.lineWidth = 4;
    ctx.beginPath(); ctx.moveTo(0, height * cell - 2); ctx.lineTo(width * cell, height * cell - 2); ctx.stroke();
    if (this.cursor) {
      ctx.strokeStyle = css("accent"); ctx.lineWidth = 3;
      ctx.strokeRect(this.cursor[1] * cell + 1.5, this.cursor[0] * cell + 1.5, cell - 3, cell - 3);
    }
  }

  async save() {
    const shown = this.see();
    const { stimulus } = await post("api/stimulus", { subject: this.subject, shown });
    const lines = (grid) => "[" + grid.map((row) => JSON.stringify(row)).join(",\n    ") + "]";
    const text = `{\n  "body": ${lines(this.cells)},\n  "stimulus": ${lines(stimulus)},\n  "control_steps": ${this.steps}\n}\n`;
    const link = element("a", { href: URL.createObjectURL(new Blob([text], { type: "application/json" })), download: "scenario.json" });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  async load() {
    const file = $("file").files[0];
    $("file").value = "";
    if (!file) return;
    const loaded = await post("api/scenario", await file.text());
    if (loaded.body.length > 32 || loaded.body[0].length > 32) throw new Error("scenario: body: the editor has room for 32 × 32 voxels");
    this.encoding = AREA("threshold"); $("pixels").value = "threshold";
    this.set(loaded.body);
    this.steps = loaded.control_steps;
    // What it saw is shown until there is another picture.
    this.stimulus = loaded.stimulus;
    this.live();
    this.say(loaded.note ? new Error(loaded.note) : null);
  }
}
