"use strict";
(() => {
  const page = JSON.parse(document.getElementById("player").textContent);
  // Text of a rollout: gzip in base64, in an element of its own.
  const unpack = async (id) => {
    const raw = atob(document.getElementById(id).textContent), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
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
    if (task) { task.addEventListener("change", choose); choose(); }
    const first = section.querySelector("button[data-first]");
    if (first) play(first, false);
  }
})();
