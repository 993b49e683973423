// Choosing a robot: archives, their map of cells, and their elites.

import { $, element, get } from "./api.js";
import { drawBody } from "./stage.js";

const FEW = 24;

export class Robots {
  // `opened` hears of the dataset of an archive, `chosen` of a robot that is to be watched, `renewed` of what is new about it.
  constructor(materials, opened, chosen, renewed) {
    Object.assign(this, { materials, opened, chosen, renewed, robot: null, from: null, all: false });
    $("archive").onchange = () => this.open(Number($("archive").value));
    $("task").onchange = () => this.show();
    $("audit").onchange = () => this.show();
    $("more").onclick = () => { this.all = true; this.show(); };
  }

  async load() {
    this.list = await get("api/archives");
    this.names();
    // An archive that was named when the page was opened comes first.
    await this.open(Math.max(0, this.list.findIndex((one) => one.chosen)));
  }

  names() {
    // Runs of one name and seed are told apart by their folders.
    const repeated = ({ name, path }) => path && this.list.filter((other) => other.name === name).length > 1;
    for (const one of this.list) one.called = repeated(one) ? `${one.name}, ${one.path.replace(/\/[^/]*$/, "")}` : one.name;
    const wanted = this.list.map(({ called, robots, generations, asked }) =>
      `${called} (${robots} ${robots === 1 ? "robot" : "robots"}${asked && generations < asked ? `, generation ${generations} of ${asked}` : ""})`);
    const select = $("archive");
    wanted.forEach((text, k) => { if (k < select.length) select.options[k].textContent = text; else select.add(new Option(text, k)); });
  }

  // What has changed meanwhile: runs that began, elites of a run that goes on. The chosen robot stays.
  async refresh() {
    const before = this.list?.[this.index]?.changes;
    this.list = await get("api/archives");
    this.names();
    const now = this.list[this.index];
    if (!now || !this.from) return;
    if (now.changes !== before) {
      const index = this.index, from = await this.archive(index);
      if (this.index !== index) return;
      this.from = from;
      const same = from.robots.find((robot) => robot.id === this.robot?.id);
      this.robot = same ?? this.robot;
      this.choices();
      this.show();
      if (same) this.renewed(same, from);
      if (!this.robot && from.robots[0]) this.choose(from.robots[0]);
    }
    await this.progress();
  }

  async archive(index) { return { ...await get("api/archives/" + index), index, name: this.list[index].called }; }

  // Chooses the robot of an id, whichever archive it is in; without one, all stays as it is.
  async find(id) {
    for (const index of this.list.keys()) {
      const robot = (await this.archive(index)).robots.find((one) => one.id === id);
      if (!robot) continue;
      if (index !== this.index) await this.open(index);
      return this.choose(robot);
    }
  }

  // The curves of a run, and how long it will go on.
  async progress() {
    const { index } = this, now = this.list[index];
    if (!now?.asked) { $("progress").hidden = true; return; }
    const course = await get(`api/archives/${index}/progress`).catch(() => null);
    if (this.index !== index) return;
    $("progress").hidden = !course || course.done < 2;
    if ($("progress").hidden) return;
    const left = course.seconds_left, at = `Generation ${course.done} of ${course.asked}`;
    const rest = !course.under_way ? (course.done < course.asked ? ", not running now" : "") : left === null ? "" : `, about ${duration(left)} left`;
    $("course").textContent = at + rest;
    $("curves").replaceChildren(...[
      ["best fitness", course.obj_max, "obj_max"], ["QD score", course.qd_score, "qd_score"], ["coverage [%]", course.coverage.map((v) => 100 * v), "coverage"],
    ].map(([name, values, key]) => curve(name, course.generation, values, key)));
  }

  async open(index) {
    this.index = index; this.all = false;
    $("archive").value = index;
    const from = await this.archive(index);
    if (this.index !== index) return;
    this.from = from;
    for (const id of ["task", "audit"]) $(id).value = "";
    this.choices();
    this.show();
    $("progress").hidden = true;
    await this.opened(this.list[index].dataset);
    if (this.index !== index) return;
    const first = this.from.robots[0];
    if (first) this.choose(first);
    await this.progress();
  }

  // The tasks and verdicts that there are, to show only robots of one. What is chosen stays if there still is a choice.
  choices() {
    const { tasks, robots, map } = this.from, verdicts = [...new Set(robots.map((robot) => robot.audit?.verdict).filter(Boolean))].sort();
    for (const [id, all, values] of [["task", "all tasks", tasks], ["audit", "all verdicts", verdicts]]) {
      const select = $(id), { value } = select, wanted = ["", ...values];
      // A list that is open stays open.
      if (wanted.join("\n") === [...select.options].map((option) => option.value).join("\n")) continue;
      const name = (text) => (id === "task" && map?.tasks[tasks.indexOf(text)]?.name) || text;
      select.replaceChildren(...wanted.map((text) => new Option(name(text) || all, text)));
      select.hidden = values.length < 2;
      select.value = !select.hidden && values.includes(value) ? value : "";
    }
  }

  show() {
    const { robots, map } = this.from, task = $("task").value, verdict = $("audit").value;
    const kept = robots.filter((robot) => (!task || robot.task === task) && (!verdict || robot.audit?.verdict === verdict));
    $("count").textContent = kept.length === robots.length ? robots.length === 1 ? "1 robot" : `${robots.length} robots, fittest first` : `${kept.length} of ${robots.length} robots`;
    const few = this.all ? kept : kept.slice(0, FEW);
    $("more").hidden = few.length === kept.length;
    $("more").textContent = `Show all ${kept.length}`;
    const held = document.activeElement, place = ["cards", "map"].find((id) => $(id).contains(held));
    $("cards").replaceChildren(...few.map((robot) => this.card(robot)));
    $("map").hidden = !map || robots.length === 0;
    if (!$("map").hidden) this.map(kept);
    this.mark();
    // A run under way is read anew under the reader's hands.
    if (place) [...$(place).querySelectorAll("[data-robot]")].find((button) => button.dataset.robot === held.dataset.robot)?.focus({ preventScroll: true });
  }

  card(robot) {
    const canvas = element("canvas"), about = element("div", {}, element("b", { textContent: robot.id }));
    about.append(element("span", { textContent: (this.from.tasks.length > 1 ? `${robot.gate ?? robot.task} · ` : "") + `fitness ${signed(robot.fitness, 2)}` }));
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

  // The cells of a task as cells.rs describes them: the task that was chosen, or that of the chosen robot. Robots that are left out
  // are pale.
  map(kept) {
    const { map, robots, tasks } = this.from, byId = new Map(robots.map((robot) => [robot.id, robot])), shown = new Set(kept);
    const wanted = $("task").value || this.robot?.task, at = Math.max(0, tasks.indexOf(wanted)), task = map.tasks[at];
    this.mapped = at;
    const panels = task.panels.map(({ voxels, rows }) => {
      const cells = element("div", { className: "cells" }, ...rows.flat().map((cell) => {
        if (cell === "impossible") return element("span");
        const robot = byId.get(cell.elite?.robot);
        if (!robot) return element("span", { className: "empty" });
        const text = `${robot.id}: fitness ${signed(robot.fitness, 2)}; ${robot.voxels.muscle} muscle, ${robot.voxels.sensor} sensor of ${robot.voxels.total} voxels`;
        const button = element("button", { type: "button", title: text, className: [robot.fitness < 0 ? "below" : "", shown.has(robot) ? "" : "faded"].join(" ").trim() });
        button.setAttribute("aria-label", text);
        button.style.backgroundColor = cell.elite.colour;
        button.dataset.robot = robot.id;
        button.onclick = () => this.choose(robot);
        return button;
      }));
      cells.dataset.columns = rows[0].length;
      return element("figure", {}, cells, element("figcaption", { textContent: `${voxels[0]}–${voxels[1]} voxels` }));
    });
    const bar = element("i"), unit = map.unit ? ` ${map.unit}` : "", own = task.has_own_scale ? " (a scale of its own, since it dwarfs the other tasks)" : "";
    bar.style.background = `linear-gradient(90deg, ${map.colours.join()})`;
    const box = (name, text, fill = "") => { const b = element("b", { className: name }); b.style.backgroundColor = fill; return element("span", {}, b, text); };
    const key = element("div", { className: "key" }, element("span", {}, `${map.tasks.length > 1 ? `Task ${task.name}. ` : ""}Muscle voxels to the right, sensor voxels upwards, a panel for each range of voxels in all.`),
      element("span", {}, "Fitness 0", bar, `${signed(task.highest, 2)}${unit}${own}`), ...(map.has_below ? [box("below", "below 0", map.below)] : []), box("empty", "no robot"));
    $("map").replaceChildren(key, ...panels);
  }

  choose(robot) {
    this.robot = robot;
    // A robot of another task is on another map.
    if (!$("map").hidden && !$("task").value && this.from.tasks.indexOf(robot.task) !== this.mapped) this.show();
    this.mark();
    this.chosen(robot, this.from);
  }

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

const duration = (seconds) => {
  const minutes = Math.round(seconds / 60);
  return seconds < 90 ? `${Math.max(1, Math.round(seconds))} s` : minutes < 90 ? `${minutes} min` : `${(minutes / 60).toFixed(1)} h`;
};

// A small curve over generations; what is not a number is left out.
const curve = (name, at, values, key) => {
  const known = at.map((x, k) => [x, values[k]]).filter(([, y]) => y !== null);
  const ys = known.map(([, y]) => y), low = Math.min(0, ...ys), high = Math.max(...ys, low + 1e-9), last = ys.at(-1);
  const X = (x) => (at.at(-1) > 0 ? 200 * x / at.at(-1) : 0), Y = (y) => 47 - 44 * (y - low) / (high - low);
  const path = known.map(([x, y], k) => `${k ? "L" : "M"}${X(x).toFixed(1)} ${Y(y).toFixed(1)}`).join("");
  const figure = element("figure", {}, element("figcaption", {}, name, element("b", { textContent: last === undefined ? "–" : signed(last, 2) })));
  figure.dataset.curve = key;
  figure.insertAdjacentHTML("beforeend", `<svg viewBox="0 0 200 50" preserveAspectRatio="none" role="img" aria-label="${name} over generations"><path d="M0 ${Y(0).toFixed(1)}H200"/><path d="${path}"/></svg>`);
  return figure;
};
