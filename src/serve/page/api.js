// What the page's parts share: the engine that answers and simulates, and helpers.

export { about, get, post, stream } from "./engine.js";

export const $ = (id) => document.getElementById(id);

export const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

export const { element } = Drawing;

// A mouse whose button went up outside the window, unseen. (Of touch not every browser tells the buttons.)
export const liftedElsewhere = (e) => e.pointerType === "mouse" && !e.buttons;

// Tabs as the ARIA practices have them: arrows move, only the chosen one is in the tab order.
export const tabs = (ids, chosen) => {
  const choose = (id) => {
    for (const own of ids) {
      $("tab-" + own).setAttribute("aria-selected", String(own === id));
      $("tab-" + own).tabIndex = own === id ? 0 : -1;
      $(own).hidden = own !== id;
    }
    chosen(id);
  };
  ids.forEach((id, k) => {
    $("tab-" + id).onclick = () => choose(id);
    $("tab-" + id).addEventListener("keydown", (e) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[e.key];
      if (!by) return;
      const next = ids[(k + by + ids.length) % ids.length];
      choose(next); $("tab-" + next).focus(); e.preventDefault(); e.stopPropagation();
    });
  });
  return choose;
};
