"use strict";
(() => {
  const page = JSON.parse(document.getElementById("player").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  // Text of a rollout: gzip in base64, in an element of its own.
  const unpack = async (id) => {
    const stream = new Blob([bytes(document.getElementById(id).textContent)]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).text();
  };
  for (const section of document.querySelectorAll("[data-run]")) {
    const frame = section.querySelector("iframe"), about = section.querySelector(".about");
    if (!frame) continue;
    let asked = 0;
    const grow = () => {
      const root = frame.contentDocument?.documentElement;
      if (root) frame.style.height = Math.min(1100, root.scrollHeight + 2) + "px";
    };
    frame.addEventListener("load", () => { grow(); if (frame.contentDocument?.body) new ResizeObserver(grow).observe(frame.contentDocument.body); });
    const play = async (button, scroll) => {
      const turn = ++asked;
      for (const other of section.querySelectorAll("button[data-robot]")) {
        other.setAttribute("aria-pressed", String(other.dataset.robot === button.dataset.robot));
      }
      about.textContent = button.dataset.about;
      const rollout = button.dataset.rollout;
      if (!rollout) {
        frame.hidden = true;
        about.textContent += " Its rollout is not in this report: " + button.dataset.command;
        return;
      }
      frame.hidden = false;
      try {
        const text = await unpack(rollout);
        // Only the robot that was asked for last.
        if (turn === asked) frame.srcdoc = page.split("%ROLLOUT%").join(text.replaceAll("<", "\\u003c"));
      } catch (error) {
        if (turn !== asked) return;
        frame.hidden = true;
        about.textContent += " This browser cannot unpack it (" + error + ").";
      }
      if (scroll && window.matchMedia("(max-width: 860px)").matches) about.scrollIntoView({ block: "start" });
    };
    const buttons = [...section.querySelectorAll("button[data-robot]")];
    buttons.forEach((button) => button.addEventListener("click", () => play(button, true)));
    // Arrow keys go from cell to cell.
    section.querySelectorAll(".map").forEach((map) => map.addEventListener("keydown", (event) => {
      const cells = [...map.querySelectorAll("button")], at = cells.indexOf(document.activeElement);
      const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: cells.length - 1 }[event.key];
      if (at < 0 || to === undefined || !cells[to]) return;
      cells[to].focus();
      event.preventDefault();
    }));
    const task = section.querySelector("select.task");
    const choose = () => section.querySelectorAll("[data-task]").forEach((map) => { map.hidden = map.dataset.task !== task.value; });
    const first = section.querySelector("button[data-first]");
    if (task) {
      // The map that the first robot is on.
      task.value = first?.closest("[data-task]").dataset.task ?? task.value;
      task.addEventListener("change", choose);
      choose();
    }
    if (first) play(first, false);
  }

  // The team: the walks under one image at a time, from the moment it is chosen.
  const team = document.querySelector("#team .watch")?.closest("section");
  if (!team) return;
  const $ = (what) => team.querySelector(what);
  const { members, classes, class_names, threshold, unit, steps, materials } = JSON.parse(document.getElementById("team-robots").textContent);
  const stages = new Stages.Team($(".stages"), $(".tally"), { members, classes, class_names, threshold, materials });
  const names = Drawing.classNames(class_names);
  const time = $("input"), last = steps.length - 1;
  // Points of a robot at all moments: differences of 8 bits to the moment before, at first 16-bit numbers.
  const moments = (text, count) => {
    const view = new DataView(bytes(text).buffer);
    let at = Array.from({ length: 2 * count }, (_, i) => view.getInt16(2 * i, true));
    const all = [at];
    for (let byte = 4 * count; byte < view.byteLength; byte += 2 * count) all.push(at = at.map((v, i) => v + view.getInt8(byte + i)));
    return all;
  };
  let walk = null, begun = 0, playing = null, asked = 0;
  // Between two moments points are on straight lines.
  const stand = (k, at) => {
    const own = walk.moments[k], a = Math.min(Math.floor(at), own.length - 1), b = Math.min(a + 1, own.length - 1), t = Math.min(at - a, 1);
    const moved = (m) => walk.tallies[m].moved[k] ?? 0;
    const points = Array.from({ length: members[k].points }, (_, i) => [0, 1].map((axis) => (own[a][2 * i + axis] * (1 - t) + own[b][2 * i + axis] * t) / unit));
    return Stages.stand(members[k].at + moved(a) * (1 - t) + moved(b) * t, points);
  };
  const draw = (at) => {
    // At the end the answer, also one that no robot voted for.
    const tally = walk.tallies[Math.floor(at)], over = at >= last, says = over ? walk.answer : tally.says;
    stages.draw(members.map((_, k) => stand(k, at)), walk.starts, { ...tally, says });
    const verdict = over ? (says === walk.class ? ": correct" : ": wrong") : "", said = Stages.said({ ...tally, says }, names);
    $(".says").textContent = `step ${steps[Math.floor(at)]} ` + (says === null ? "" : `says ${said.says}${said.tie && ` (${said.tie})`}${verdict}`);
    $(".play").textContent = playing === null ? "Play" : "Pause";
  };
  const at = () => Number(time.value);
  const run = (now) => {
    // A second of a robot's time is fifty control steps.
    const step = (now - begun) / 20, next = steps.findIndex((other) => other > step);
    const to = next < 0 ? last : next - 1 + (step - steps[next - 1]) / (steps[next] - steps[next - 1]);
    time.value = String(Math.floor(to));
    playing = to < last ? requestAnimationFrame(run) : null;
    draw(to);
  };
  const hold = () => { if (playing !== null) cancelAnimationFrame(playing); playing = null; };
  const go = (from) => { hold(); playing = requestAnimationFrame((now) => { begun = now - 20 * steps[from]; run(now); }); };
  const watch = async (button) => {
    const turn = ++asked;
    hold();
    delete team.dataset.walks;
    team.querySelectorAll(".watch button").forEach((other) => other.setAttribute("aria-pressed", String(other === button)));
    try {
      const found = JSON.parse(await unpack(button.dataset.walks));
      if (turn !== asked) return;
      team.dataset.walks = button.dataset.walks;
      walk = { ...found, moments: found.frames.map((text, k) => moments(text, members[k].points)) };
      walk.starts = members.map((_, k) => stand(k, 0));
      if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) { time.value = String(last); draw(last); } else go(0);
    } catch (error) {
      $(".says").textContent = `This browser cannot unpack it (${error}).`;
    }
  };
  team.querySelectorAll(".watch button").forEach((button) => button.addEventListener("click", () => watch(button)));
  time.addEventListener("input", () => { if (walk) { hold(); draw(at()); } });
  $(".play").addEventListener("click", () => { if (walk) { if (playing !== null) { hold(); draw(at()); } else go(at() >= last ? 0 : at()); } });
  window.addEventListener("resize", () => { if (walk && playing === null) draw(at()); });
  watch($(".watch button"));
})();
