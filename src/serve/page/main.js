// The page: which robot sees which picture, and what the simulation shows.

import { $, about, element, get, post, tabs } from "./api.js";
import { Editor } from "./editor.js";
import { Images } from "./images.js";
import * as links from "./links.js";
import { Simulation } from "./simulation.js";
import { Pad } from "./pad.js";
import { Robots, rows, signed } from "./robots.js";
import { Stage, drawStimulus, drawWhole } from "./stage.js";
import { Team } from "./team.js";

// Strokes may follow each other that fast without a simulation for each.
const AFTER_STROKE = 300, WHILE_DRAWING = 60;
// An answer of more letters is set small.
const LONG = 14;

const say = (error) => {
  if (error?.name === "AbortError") return;
  $("error").hidden = !error;
  $("error").textContent = error ? error.message : "";
};

// Without an engine there is no page, only the reason.
const materials = await get("api/materials").catch((error) => {
  say(error);
  $("status").textContent = "not running";
  $("status").dataset.state = "lost";
  throw error;
});
let simulation = null, timer = 0, seen = null, previous = 0, drawn = null, looked = 0;
// The picture: { drawing } or { image }; and the words for it.
let picture = { shown: {}, about: "nothing, it is dark" };
// Whose simulation it is: a robot of an archive, or the editor's body.
let who = null;

const shownTo = () => (who?.own && editor.stimulus ? { stimulus: editor.stimulus } : picture.shown);

// The page's state, for tests: waiting for the hand to rest, simulating, over.
const mark = (state) => { document.documentElement.dataset.state = state; };

// What was said of the walk before.
const forget = () => {
  $("verdict").dataset.state = "idle";
  for (const id of ["says", "moved", "step"]) $(id).textContent = "";
};

// Classes in a sentence: "0, 1 or 2". Many are cut short.
const MOST_CLASSES = 10;
const listed = (classes, name, word) => {
  const some = classes.slice(0, MOST_CLASSES).map(name);
  if (some.length < classes.length) return `${some.join(", ")} …`;
  return some.length > 1 ? `${some.slice(0, -1).join(", ")} ${word} ${some.at(-1)}` : some.join("");
};

// All digits, by number and without a name.
const isDigits = (classes, names) => !names && classes.length === 10;

// What the chosen body knows, above the pad and beside its answer: it names none but these classes, whatever is drawn.
const invite = () => {
  const say = (invites, knows = "") => { $("invites").replaceChildren(...[invites].flat()); $("knows").textContent = knows; };
  if (!who) return say("");
  const gate = who.robot?.gate;
  if (gate) return say(`This body computes ${gate} of cues, not of drawings: switch them under Test images.`);
  const { left = [], right = [] } = who.robot?.judge ?? {};
  const classes = who.team ? team.classes : left.concat(right).sort((a, b) => a - b);
  if (!classes.length) return say(`Draw anything. This body ${who.own ? "has no task" : "names no class"}: only the direction of its walk counts.`);
  const given = who.team ? team.class_names : who.from.class_names, { a, name } = Drawing.classNames(given);
  if (isDigits(classes, given)) return say("Draw any digit from 0 to 9.");
  const invites = [`Draw ${classes.length > 3 ? "one of " + listed(classes, name, "or") : listed(classes, a, "or")}.`];
  const knows = `it knows only ${listed(classes, name, "and")}`;
  // The team answers about more classes of the same data.
  const wider = !who.team && team.classes && String(team.class_names ?? "") === String(given ?? "") && classes.every((label) => team.classes.includes(label)) && team.classes.length > classes.length;
  if (wider) {
    const link = element("a", { href: "#team", textContent: "Team" });
    link.onclick = (e) => { e.preventDefault(); $("tab-team").click(); };
    invites.push(` For ${isDigits(team.classes, given) ? "all ten digits" : listed(team.classes, name, "and")}: `, link);
  }
  say(invites, knows);
};

const start = () => {
  clearTimeout(timer);
  if (!who) return;
  forget();
  invite();
  mark("living");
  simulation?.stop();
  team.stop();
  $("together").hidden = !who.team;
  document.querySelector(".world").hidden = !!who.team;
  for (const id of ["time", "step"]) $(id).hidden = !!who.team;
  if (who.team) {
    simulation = null;
    team.start(picture.shown, Number($("speed").value)).catch(say).finally(() => { drawn = null; status(); });
    say(null);
    status();
    return;
  }
  const own = new Simulation({ subject: who.subject(), shown: shownTo(), control_steps: who.steps() }, Number($("speed").value), (name) => {
    if (simulation !== own) return;
    if (name === "begin" || name === "seen") { seen = own.phase(own.last); look(); }
    drawn = null;
  });
  simulation = own;
  own.running.catch((error) => { if (simulation === own) say(error); }).finally(() => { own.lose(); drawn = null; status(); });
  say(null);
  status();
};

// The picture has changed: the same simulation sees it, or a fresh one does.
const show = (next, after) => {
  picture = next;
  editor.stimulus = null;
  clearTimeout(timer);
  if ($("manner").value === "on" && simulation?.begun && !simulation.end) timer = setTimeout(() => simulation.change({ shown: picture.shown }).catch(say), after ? WHILE_DRAWING : 0);
  else {
    mark("waiting");
    timer = setTimeout(start, after);
  }
};

// While a stroke is drawn, what it looks like to the sensors.
const glance = async () => {
  if (!who || who.team) return;
  const number = ++looked;
  const answer = await post("api/stimulus", { subject: who.subject(), shown: shownTo() });
  if (number === looked) { seen = answer; look(); }
};

const look = () => {
  $("picture").textContent = picture.about;
  if (!seen || !who) return;
  drawWhole($("whole"), seen.image);
  drawStimulus($("stimulus"), seen.stimulus, who.rows(), materials);
};

let glancing = 0;
const pad = new Pad($("pad"), (done) => {
  const next = { shown: { drawing: pad.rows }, about: "your drawing" };
  images.mark(null);
  if (done) return show(next, AFTER_STROKE);
  picture = next; editor.stimulus = null;
  clearTimeout(timer);
  if ($("manner").value === "on" && simulation?.begun && !simulation.end) timer = setTimeout(() => simulation.change({ shown: next.shown }).catch(say), WHILE_DRAWING);
  else if (!glancing) glancing = setTimeout(() => { glancing = 0; glance().catch(say); }, WHILE_DRAWING);
});

const images = new Images(({ image, about }) => show({ shown: { image }, about }, 0));

// What is said of a robot.
const introduce = (robot, from) => {
  const { encoding, level } = robot.encoding;
  const way = { saturated: "1 where there is any ink", intensity: "as dark as the ink", threshold: `1 above ${level}` }[encoding];
  const margins = [robot.encoding.margin ?? 0].flat(), part = margins.some((margin) => margin > 0) ? "a part of it, " : "";
  $("encoding").textContent = `${part}${robot.body.length} × ${robot.body[0].length} pixels, ${way}`;
  $("who").textContent = robot.id;
  const audit = robot.audit ? ` · audit: ${robot.audit.conclusion}` : "";
  $("about").textContent = `${from.name} · ${robot.gate ? `gate ${robot.gate}` : `task ${robot.task}`} · fitness ${signed(robot.fitness, 2)} · ${robot.voxels.total} voxels${audit}`;
};

const choose = (robot, from) => {
  who = {
    robot, from, name: robot.id,
    subject: () => ({ archive: from.index, robot: robot.id }),
    rows: () => rows(robot), steps: () => Math.min(from.control_steps, 5000),
  };
  introduce(robot, from);
  links.name({ robot: robot.id });
  const { left, right } = robot.judge ?? { left: [], right: [] };
  images.labels = left.concat(right).length ? left.concat(right) : null;
  start();
};

// It walks on, whatever has been found of it meanwhile.
const renew = (robot, from) => { if (who?.robot?.id === robot.id && who.from.index === from.index) introduce(robot, from); };

// An archive's robots see images of its dataset; cues are no digits, and digits no cues.
const opened = async (dataset) => {
  const before = images.set.cues, own = images.has(dataset);
  if (!own && (!before || images.set.name === dataset)) return;
  await images.open(own ? dataset : "builtin");
  if (before || images.set.cues) pictured();
};

const pictured = () => {
  const first = images.shown[0];
  if (first) picture = { shown: { image: { set: images.set.name, index: first.index } }, about: images.about(first) };
};

const robots = new Robots(materials, opened, choose, renew);

const editor = new Editor(materials, {
  say,
  chosen: () => robots.robot && { robot: robots.robot, encoding: robots.robot.encoding },
  see: () => (editor.stimulus ? { stimulus: editor.stimulus } : picture.shown),
  live: () => {
    who = { own: true, name: "Your body", subject: () => editor.subject, rows: () => editor.cells.map((row) => row.join("")), steps: () => editor.steps };
    $("who").textContent = "Your body";
    $("about").textContent = "from the editor";
    $("encoding").textContent = `${editor.cells.length} × ${editor.cells[0].length} pixels`;
    links.name({ body: editor.cells });
    start();
  },
});

const team = new Team(materials, (name, walk) => {
  if (name === "begin") { seen = walk.begun.seen; look(); }
  drawn = null;
});

// The whole team instead of one robot.
const together = () => {
  who = { team: true, name: "The team", rows: () => [] };
  $("who").textContent = "The team";
  $("about").textContent = `${team.members.length} robots answer together`;
  $("encoding").textContent = "as the robots of the team see it together";
  images.labels = team.classes;
  start();
};

const drawTeam = () => {
  team.draw();
  const walk = team.walk;
  if (!walk?.begun) return;
  const says = walk.tally?.says ?? null, known = walk.end && says !== null && walk.begun.classes.includes(walk.begun.seen.label);
  $("verdict").dataset.state = known ? (says === walk.begun.seen.label ? "right" : "wrong") : says === null ? (walk.end ? "none" : "idle") : "answer";
  const { says: all, tie } = Stages.said(walk.tally, team.names), said = says === null && walk.end ? "undecided" : all;
  $("verdict").dataset.long = String(said.length > LONG);
  $("says").textContent = said;
  // A device that is too slow for all lets the first robots walk in time.
  const { until, members } = walk.begun, { behind } = walk;
  const step = behind ? `${members.length - behind.robots} robots at step ${walk.step}, ${behind.robots} at ${behind.step} of ${until}` : `step ${walk.step} of ${until}`;
  $("moved").textContent = `${tie ? `${tie} · ` : ""}${step}`;
  const play = walk.end || walk.paused ? "Play" : "Pause";
  if ($("play").textContent !== play) $("play").textContent = play;
  if (walk.end && !walk.told) {
    walk.told = true;
    if (document.documentElement.dataset.state === "living") mark("over");
    $("spoken").textContent = `The team sees ${picture.about}. It says ${says === null ? "nothing" : tie ? `${said}, ${tie}` : said}.`;
  }
};

const words = (answer, over) => {
  const distance = Math.abs(answer.moved).toFixed(1);
  if (!answer.way) return { state: over ? "none" : "idle", says: over ? "undecided" : "", moved: `moved ${distance} voxel lengths` };
  const { name } = Drawing.classNames(simulation.begun.class_names);
  const says = answer.says.length ? answer.says.map(name).join(" or ") : answer.way === "left" ? "←" : "→";
  const label = simulation.phase(simulation.frame).label;
  const { left, right } = simulation.begun.judge ?? { left: [], right: [] };
  const known = over && answer.says.length && left.concat(right).includes(label);
  return { state: known ? (answer.says.includes(label) ? "right" : "wrong") : "answer", says, moved: `moved ${distance} voxel lengths ${answer.way}` };
};

const draw = () => {
  if (who?.team) return drawTeam();
  const ready = simulation?.begun && simulation.moments.length;
  const answer = ready ? simulation.answered(simulation.frame) : null;
  stage.draw(simulation, answer);
  if (!ready) return;
  const unstable = simulation.over && simulation.end.unstable;
  const text = unstable ? { state: "none", says: "unstable", moved: simulation.end.unstable } : words(answer, simulation.over);
  $("verdict").dataset.state = text.state;
  $("verdict").dataset.long = String(text.says.length > LONG);
  $("says").textContent = text.says;
  $("moved").textContent = text.moved;
  const play = simulation.over ? "Play" : simulation.playing ? "Pause" : "Play";
  if ($("play").textContent !== play) $("play").textContent = play;
  $("time").max = Math.max(simulation.until, 1);
  $("time").value = simulation.frame;
  $("step").textContent = `step ${simulation.frame} of ${simulation.until}`;
  $("time").setAttribute("aria-valuetext", $("step").textContent);
  $("world").setAttribute("aria-label", `${who.name} sees ${picture.about}; ${text.moved}`);
  if (simulation.over && simulation.told !== simulation.end) {
    simulation.told = simulation.end;
    if (document.documentElement.dataset.state === "living") mark("over");
    $("spoken").textContent = `${who.name} sees ${picture.about}. ${text.says ? `It says ${text.says}: ` : ""}${text.moved}.`;
  }
};

const stage = new Stage($("world"), materials);
const tick = (now) => {
  simulation?.pass(Math.min(now - previous, 200) / 1000);
  previous = now;
  if (team.walk?.stale) drawn = null;
  const state = simulation?.begun ? `${simulation.frame} ${simulation.last} ${simulation.end !== null} ${simulation.playing}` : "none";
  if (state !== drawn) { drawn = state; draw(); }
  requestAnimationFrame(tick);
};

const play = () => {
  if (who?.team && !team.over) return void team.change({ paused: !team.walk?.paused }).then(() => { if (team.walk) team.walk.stale = true; }, say);
  if (!simulation || simulation.over) return start();
  simulation.play(!simulation.playing).catch(say);
  drawn = null;
};
$("play").onclick = play;
$("again").onclick = start;
$("speed").onchange = () => (who?.team ? team.change({ speed: Number($("speed").value) }) : simulation?.pace(Number($("speed").value)))?.catch(say);
$("time").oninput = () => {
  if (!simulation?.begun) return;
  if (simulation.playing) simulation.play(false).catch(say);
  simulation.look(Number($("time").value));
  drawn = null;
};
document.addEventListener("keydown", (e) => {
  if (e.ctrlKey || e.metaKey || e.altKey || e.target.matches("select, input, canvas[tabindex]")) return;
  if (e.key === " " && !e.target.matches("button")) play();
  else if (e.key === "r" || e.key === "R") start();
  else return;
  e.preventDefault();
});

const status = async () => {
  try {
    const { simulations, max_simulations: most } = await get("api/status");
    $("status").dataset.state = simulations ? "alive" : "";
    $("status").textContent = simulations === 1 ? "1 simulation running" : `${simulations} simulations running`;
    $("status").title = `at most ${most} at once`;
  } catch {
    $("status").dataset.state = "lost";
    $("status").textContent = "morphcog has ended";
  }
};
setInterval(() => {
  if (document.hidden) return;
  status();
  if (!who?.team) team.load().catch(() => { /* so does status */ });
  if (robots.from) robots.refresh().catch(() => { /* status says that the program has ended */ });
}, 2000);

tabs(["draw", "test"], (id) => { if (id === "draw") pad.draw(); else images.draw(); });
tabs(["robots", "team", "editor"], (id) => {
  if (id === "team") together();
  else if (who?.team && robots.robot) choose(robots.robot, robots.from);
  document.querySelector("main").dataset.tab = id;
  // The stage has another size there.
  redraw();
});
for (const material of materials.list.slice(1)) {
  $("legend").append(element("li", {}, Drawing.swatch(material), material.name));
}
const redraw = () => { drawn = null; if (team.walk) team.walk.stale = true; look(); pad.draw(); editor.draw(); };
window.addEventListener("resize", redraw);
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { redraw(); images.draw(); });
// A tab that closes drops its connection, and with it its simulation.
window.addEventListener("pagehide", () => { simulation?.stop(); team.stop(); });
requestAnimationFrame(tick);

try {
  await images.load();
  // Something to see at once: a test image, unless motion is not wanted.
  pictured();
  const linked = links.named();
  await robots.load();
  await team.load();
  if (linked?.robot) await robots.find(linked.robot);
  if (linked?.body) { $("tab-editor").click(); editor.set(linked.body); $("live").click(); }
  invite();
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) simulation?.play(false);
} catch (error) { say(error); }
document.documentElement.dataset.ready = "yes";
// What the engine says of itself.
about().then((words) => { $("engine").hidden = !words; $("engine").textContent = words ?? ""; }, say);
