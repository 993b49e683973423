// Test images: pages of one class.

import { $, element, get } from "./api.js";

const { css } = Drawing;
const PAGE = 15;

export class Images {
  constructor(chosen) {
    this.chosen = chosen; this.sets = []; this.set = null; this.class = 0; this.from = 0; this.picked = null;
    $("set").onchange = async () => {
      await this.open($("set").value);
      if (this.set.cues && this.shown[0]) this.choose(this.shown[0]);
    };
    $("newer").onclick = () => this.turn(-PAGE);
    $("older").onclick = () => this.turn(PAGE);
    $("lucky").onclick = () => this.lucky();
  }

  async load() {
    this.sets = await get("api/images");
    for (const { name } of this.sets) $("set").add(new Option(name === "builtin" ? "built-in digits" : name, name));
    await this.open(this.sets[0].name);
  }

  // True if there is such a set, and another one is open.
  has(name) { return name !== this.set.name && this.sets.some((set) => set.name === name); }

  async open(name) {
    this.set = this.sets.find((set) => set.name === name) ?? this.set;
    $("set").value = this.set.name;
    this.names = Drawing.classNames(this.set.class_names);
    $("classes").toggleAttribute("data-named", !!this.set.class_names);
    $("classes").replaceChildren(...this.set.classes.map(([label]) => {
      const button = element("button", { type: "button", textContent: this.names.name(label), title: this.set.class_names?.[label] ?? "" });
      button.dataset.class = label;
      button.onclick = () => this.show(label);
      return button;
    }));
    this.switches();
    await this.show(this.set.classes.some(([label]) => label === this.class) ? this.class : this.set.classes[0][0]);
  }

  // Images of cues are switched one cue at a time, and a walk goes on meanwhile.
  switches() {
    const cues = this.set.cues ?? 0;
    if (cues && $("cues").hidden) { this.manner = $("manner").value; $("manner").value = "on"; }
    if (!cues && !$("cues").hidden) $("manner").value = this.manner;
    $("cues").hidden = !cues;
    if (cues) $("tab-test").click();
    for (const id of ["classes", "thumbs", "newer", "older", "lucky"]) $(id).hidden = !!cues;
    $("cues").replaceChildren(...Array.from({ length: cues }, (_, cue) => {
      const button = element("button", { type: "button" }), bit = 1 << (cues - 1 - cue);
      button.dataset.bit = bit; button.dataset.cue = `Cue ${"abcd"[cue]}`;
      button.onclick = async () => {
        const wanted = this.class ^ bit;
        await this.show(wanted);
        if (this.class === wanted && this.shown[0]?.label === wanted) this.choose(this.shown[0]);
      };
      return button;
    }));
  }

  get total() { return this.set.classes.find(([label]) => label === this.class)?.[1] ?? 0; }

  async show(label) { this.class = label; this.from = 0; await this.page(); }

  async turn(by) { this.from = Math.max(0, Math.min(this.from + by, Math.floor((this.total - 1) / PAGE) * PAGE)); await this.page(); }

  async page() {
    const wanted = `api/images?set=${this.set.name}&class=${this.class}&from=${this.from}&count=${PAGE}`;
    this.wanted = wanted;
    const images = await get(wanted);
    if (this.wanted !== wanted) return;
    [...$("classes").children].forEach((b) => b.setAttribute("aria-pressed", String(Number(b.dataset.class) === this.class)));
    $("newer").disabled = this.from === 0;
    $("older").disabled = this.from + PAGE >= this.total;
    this.shown = images;
    this.draw();
  }

  draw() {
    for (const button of $("cues").children) {
      const is = !!(this.class & button.dataset.bit), { cue } = button.dataset;
      button.textContent = `${cue}: ${is ? "bright" : "dark"}`;
      button.setAttribute("aria-label", `${cue} bright`);
      button.setAttribute("aria-pressed", String(is));
    }
    const ink = hex(css("ink"));
    $("thumbs").replaceChildren(...(this.shown ?? []).map((image) => {
      const canvas = element("canvas"), what = this.names.a(image.label), label = `${what[0].toUpperCase()}${what.slice(1)}, image ${image.index}`;
      paint(canvas, image.pixels, ink);
      const button = element("button", { type: "button", title: label }, canvas);
      button.setAttribute("aria-label", label);
      button.setAttribute("aria-pressed", String(this.picked?.set === this.set.name && this.picked.index === image.index));
      button.onclick = () => this.choose(image);
      return button;
    }));
  }

  // The image that is shown to the robot; null: another picture is.
  mark(picked) { if (picked || this.picked) { this.picked = picked; this.draw(); } }

  choose(image) {
    this.mark({ set: this.set.name, index: image.index });
    this.chosen({ image: { set: this.set.name, index: image.index }, about: this.about(image) });
  }

  about({ label, index }) { return `${this.names.a(label)} (${this.set.name} test image ${index})`; }

  async lucky() {
    const all = this.labels ?? this.set.classes.map(([label]) => label);
    this.class = all[Math.floor(Math.random() * all.length)];
    const at = Math.floor(Math.random() * this.total);
    this.from = Math.floor(at / PAGE) * PAGE;
    await this.page();
    if (this.shown[at - this.from]) this.choose(this.shown[at - this.from]);
  }
}

const hex = (colour) => [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));

const paint = (canvas, rows, ink) => {
  canvas.height = rows.length; canvas.width = rows[0].length;
  const ctx = canvas.getContext("2d"), data = ctx.createImageData(canvas.width, canvas.height);
  rows.flat().forEach((value, k) => data.data.set([...ink, value], 4 * k));
  ctx.putImageData(data, 0, 0);
};
