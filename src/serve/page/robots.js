// Choosing a robot: archives, their map of cells, and their elites.

import { $, element, get } from "./api.js";
import { drawBody } from "./stage.js";

const FEW = 24;

export class Robots {
  constructor(materials, chosen) {
    this.materials = materials; this.chosen = chosen; this.robot = null; this.from = null; this.all = false;
    $("archive").onchange = () => this.open(Number($("archive").value));
    $("task").onchange = () => this.show();
    $("audit").onchange = () => this.show();
    $("more").onclick = () => { this.all = true; this.show(); };
  }

  async load() {
    this.list = await get("/api/archives");
    for (const { index, name, robots } of this.list) $("archive").add(new Option(`${name} (${robots} robots)`, index));
    await this.open(0);
  }

  async open(index) {
    this.index = index; this.all = false;
    $("archive").value = index;
    const from = { index, ...await get("/api/archives/" + index) };
    if (this.index !== index) return;
    this.from = from;
    const choices = (id, name, values) => {
      $(id).replaceChildren(new Option(name, ""), ...values.map((value) => new Option(value, value)));
      $(id).hidden = values.length < 2;
    };
    choices("task", "all tasks", this.from.tasks);
    const verdicts = [...new Set(this.from.robots.map((robot) => robot.audit?.verdict).filter(Boolean))].sort();
    choices("audit", "all verdicts", verdicts);
    this.show();
    const first = this.from.robots[0];
    if (first) this.choose(first);
  }

  show() {
    const { robots, bins } = this.from, task = $("task").value, verdict = $("audit").value;
    const kept = robots.filter((robot) => (!task || robot.task === task) && (!verdict || robot.audit?.verdict === verdict));
    $("count").textContent = kept.length === robots.length ? `${robots.length} robots, fittest first` : `${kept.length} of ${robots.length} robots`;
    const few = this.all ? kept : kept.slice(0, FEW);
    $("more").hidden = few.length === kept.length;
    $("more").textContent = `Show all ${kept.length}`;
    $("cards").replaceChildren(...few.map((robot) => this.card(robot)));
    $("map").hidden = bins.length !== 3 || robots.length === 0;
    if (!$("map").hidden) this.map(kept);
    this.mark();
  }

  card(robot) {
    const canvas = element("canvas"), about = element("div", {}, element("b", { textContent: robot.id }));
    about.append(element("span", { textContent: (this.from.tasks.length > 1 ? `${robot.task} · ` : "") + `fitness ${signed(robot.fitness, 2)}` }));
    if (robot.audit) {
      const audit = element("span", { className: "audit", textContent: robot.audit.conclusion });
      audit.dataset.verdict = robot.audit.verdict;
      about.append(audit);
    }
    const button = element("button", { type: "button" }, canvas, about);
    button.dataset.robot = robot.id;
    button.onclick = () => this.choose(robot);
    drawBody(canvas, rows(robot), this.materials, 56);
    return button;
  }

  // One panel per bin of size; in it, bins of muscle (up) and sensor voxels (to the right). More of either than all
  // there is is not possible, so panels grow.
  map(robots) {
    const [muscle, sensor, total] = this.from.bins, best = new Map();
    for (const robot of robots) {
      const key = robot.cell.slice(0, 3).join();
      if (!best.has(key) || best.get(key).fitness < robot.fitness) best.set(key, robot);
    }
    const values = robots.map((robot) => robot.fitness);
    // A robot that fails, fails: by how much would hide what the others do.
    const high = Math.max(...values), least = Math.min(...values), low = high > 0 ? Math.max(0, least) : least;
    const panels = Array.from({ length: total }, (_, t) => {
      const cells = element("div", { className: "cells" }), wide = Math.min(sensor, t + 1);
      cells.style.gridTemplateColumns = `repeat(${wide}, auto)`;
      for (let m = Math.min(muscle, t + 1) - 1; m >= 0; m--) for (let s = 0; s < wide; s++) {
        const robot = best.get([m, s, t].join());
        if (!robot) { cells.append(element("i")); continue; }
        const share = high > low ? 100 * Math.max(0, robot.fitness - low) / (high - low) : 100;
        const text = `${robot.id}: fitness ${signed(robot.fitness, 2)}; ${robot.voxels.muscle} muscle, ${robot.voxels.sensor} sensor of ${robot.voxels.total} voxels`;
        const button = element("button", { type: "button", title: text });
        button.setAttribute("aria-label", text);
        button.style.background = `color-mix(in oklab, var(--map-low), var(--map-high) ${share.toFixed(0)}%)`;
        button.dataset.robot = robot.id;
        button.onclick = () => this.choose(robot);
        cells.append(button);
      }
      return element("figure", {}, cells, element("figcaption", { textContent: `size ${t + 1}` }));
    });
    const ends = element("span", { className: "ends" }, element("span", { textContent: (least < low ? "≤ " : "") + signed(low, 1) }), element("span", { textContent: signed(high, 1) }));
    const key = element("p", { className: "key" }, "Cells of the archive: muscle voxels upwards, sensors to the right, a panel per size of the body. Fitness:", element("span", { className: "scale" }), ends);
    $("map").replaceChildren(...(robots.length ? panels : []), key);
  }

  choose(robot) { this.robot = robot; this.mark(); this.chosen(robot, this.from); }

  mark() {
    for (const button of document.querySelectorAll("[data-robot]")) {
      button.setAttribute("aria-pressed", String(button.dataset.robot === this.robot?.id));
    }
  }
}

// A number with a minus sign that is one; what rounds to nothing has none.
export const signed = (value, digits) => {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
};

// A body's rows as text, as the drawing functions take them.
export const rows = (robot) => robot.body.map((row) => row.join(""));
