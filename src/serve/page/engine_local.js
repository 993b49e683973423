// The engine of the page without a server: the simulator as a WebAssembly module, in workers of the browser. It answers what the server
// of `morphcog serve` answers, to the same requests.

// One worker a core; more would wait for each other.
const CORES = Math.max(1, Math.min(8, navigator.hardwareConcurrency || 2));
// Milliseconds between two advances in real time, and the longest that one should take.
const TICK = 40, LONGEST = 80;
// The most control steps of one advance, and the seconds that a slow machine tries to make up for.
const BATCH = 20, BEHIND = 0.5;
const TOO_OLD = "This browser cannot run the simulator: it lacks WebAssembly with SIMD, which Chrome and Edge have since 91, Firefox since 89 and Safari since 16.4.";
// The least module that needs SIMD.
const SIMD = new Uint8Array([0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11]);

const failed = (status, line) => Object.assign(new Error(line.trim()), { status });

// A file of the site; servers may or may not have unpacked it on its way.
const bytesOf = async (name) => {
  const response = await fetch(name);
  if (!response.ok) throw failed(response.status, `${name}: ${response.status} ${response.statusText}`);
  const packed = new Uint8Array(await response.arrayBuffer());
  if (packed[0] !== 0x1f || packed[1] !== 0x8b) return packed;
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
};

const loaded = (async () => {
  if (typeof WebAssembly !== "object" || !WebAssembly.validate(SIMD) || typeof DecompressionStream !== "function") throw failed(0, TOO_OLD);
  const text = (name) => bytesOf(name).then((bytes) => new TextDecoder().decode(bytes));
  const [module, gallery, worker] = await Promise.all([bytesOf("simulator.gz").then((bytes) => WebAssembly.compile(bytes)), text("gallery.gz"), text("worker.js")]);
  // Further workers begin without the server, which may be gone by then.
  return { module, gallery, worker: URL.createObjectURL(new Blob([worker], { type: "text/javascript" })) };
})();
loaded.catch(() => { /* whoever asks hears of it */ });

// A worker, which answers one call after the other.
class Hand {
  constructor() {
    this.waiting = [];
    this.busy = 0;
    this.ready = loaded.then(({ module, gallery, worker }) => {
      this.worker = new Worker(worker);
      this.worker.onmessage = ({ data }) => this.waiting.shift().resolve(data);
      this.worker.onerror = (event) => { for (const one of this.waiting.splice(0)) one.reject(failed(500, event.message || "a worker could not start")); };
      return this.send({ module }).then(() => this.send({ call: "open", gallery }));
    }).then(checked);
    this.ready.catch(() => { /* whoever calls hears of it */ });
  }

  send(message) {
    return new Promise((resolve, reject) => {
      this.waiting.push({ resolve, reject });
      this.worker.postMessage(message);
    });
  }

  // The answer's text; 400 and above are errors with one line.
  async call(message) { await this.ready; return checked(await this.send(message)); }
}

const checked = ({ status, text }) => {
  if (status >= 400) throw failed(status, text);
  return text;
};

const hands = [];
const hand = (number) => (hands[number] ??= new Hand());
// The others only once they are needed.
const all = () => Array.from({ length: CORES }, (_, number) => hand(number));

const events = (text) => text.split("\n\n").flatMap((event) => {
  const name = /^event: (.*)$/m.exec(event), data = /^data: (.*)$/m.exec(event);
  return name && data ? [[name[1], JSON.parse(data[1])]] : [];
});

const running = new Map();
let begun = 0;

// Answers a request as the server would.
export const answer = async (method, target, body) => {
  const first = hand(0);
  await first.ready;
  return first.send({ call: "answer", method, target, body });
};

export const get = async (path) => {
  const value = JSON.parse(checked(await answer("GET", "/" + path, "")));
  return path === "api/status" ? { ...value, simulations: running.size, max_simulations: CORES } : value;
};

export const post = async (path, value) => {
  const body = typeof value === "string" ? value : JSON.stringify(value), of = /^api\/simulations\/(\d+)$/.exec(path);
  if (of) {
    const simulation = running.get(Number(of[1]));
    if (!simulation) throw failed(404, "the simulation has ended");
    return simulation.change(value);
  }
  const text = checked(await answer("POST", "/" + path, body));
  return text ? JSON.parse(text) : null;
};

// When control steps are due, as the server's clock has it.
class Clock {
  constructor(speed) { this.speed = speed ?? 1; this.paused = false; this.begin = null; this.cost = 1; }

  set({ speed, paused }) {
    if (speed === undefined && paused === undefined) return;
    this.speed = speed ?? this.speed; this.paused = paused ?? this.paused; this.begin = null;
  }

  due(step) {
    const most = Math.max(1, Math.floor(LONGEST / this.cost));
    if (!this.speed) return Math.min(BATCH, most);
    const rate = 50 * this.speed, now = performance.now() / 1000;
    this.begin ??= [now, step];
    const due = this.begin[1] + (now - this.begin[0]) * rate - step;
    if (due > rate * BEHIND) this.begin = null;
    return Math.floor(Math.max(0, Math.min(due, Math.max(BATCH, rate / 10), most)));
  }

  // How long one control step takes here, smoothed.
  took(milliseconds, steps) { if (steps) this.cost = smoothed(this.cost, milliseconds / steps); }
}

const smoothed = (old, now) => 0.7 * old + 0.3 * now;

// A result, and how many milliseconds it took.
const timed = async (work) => {
  const before = performance.now(), result = await work();
  return [result, performance.now() - before];
};

const sleep = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
// Nobody looks at a hidden tab, so nothing is computed for it.
const seen = async () => {
  while (document.hidden) await new Promise((resolve) => document.addEventListener("visibilitychange", resolve, { once: true }));
};

// Advances a simulation at its pace until it ends or is dropped. `advance` says whether it is "over" or "behind" its pace.
const run = async (clock, signal, step, advance) => {
  for (let said = null; said !== "over";) {
    if (document.hidden) { await seen(); clock.begin = null; }
    if (signal.aborted) throw new DOMException("dropped", "AbortError");
    const due = clock.paused ? 0 : clock.due(step());
    said = due || (said === "behind" && !clock.paused) ? await advance(due) : null;
    // A message to itself gives the page time to draw.
    if (said !== "over") await sleep(said === "behind" || (due && !clock.speed) ? 0 : TICK);
  }
};

export const stream = (path, value, signal, tell) => (path === "api/team" ? team : robot)(path, value, signal, tell);

const robot = async (path, value, signal, tell) => {
  await loaded;
  const own = all().reduce((least, one) => (one.busy < least.busy ? one : least)), clock = new Clock(value.speed);
  own.busy++;
  const id = ++begun;
  let inner = null, step = 0;
  try {
    const hear = ([name, data]) => {
      if (name === "begin") { inner = data.id; data.id = id; }
      if (data.step !== undefined) step = data.step;
      tell(name, data);
      return name === "end";
    };
    const first = events(await own.call({ call: "begin", target: "/" + path, body: JSON.stringify(value) }));
    running.set(id, {
      change: async (news) => {
        clock.set(news);
        if (!news.shown) return null;
        const text = await own.call({ call: "answer", method: "POST", target: `/api/simulations/${inner}`, body: JSON.stringify({ shown: news.shown }) });
        events(text).forEach(hear);
        return null;
      },
    });
    first.forEach(hear);
    await run(clock, signal, () => step, async (due) => {
      const [text, took] = await timed(() => own.call({ call: "advance", id: inner, due }));
      clock.took(took, due);
      return events(text).map(hear).some(Boolean) ? "over" : null;
    });
  } finally {
    running.delete(id);
    own.busy--;
    if (inner !== null) own.call({ call: "end", id: inner }).catch(() => { /* it has ended */ });
  }
};

// The robots of a team's first classes walk at the pace that is asked for, the others with what the device has left.
const FIRST_CLASSES = 4;

// Some members of a team, shared out among all workers.
class Part {
  constructor(numbers) { this.numbers = numbers; this.step = 0; this.cost = 10; this.shares = []; this.frames = []; this.moved = []; }

  // Returns the first event, with all of its members that walk here.
  async begin(target, body) {
    const workers = all();
    const share = (worker, k) => ({ worker, numbers: this.numbers.filter((_, place) => place % workers.length === k) });
    const shares = workers.map(share).filter(({ numbers }) => numbers.length);
    const begun = await Promise.all(shares.map(async (one) => {
      const [[, data]] = events(await one.worker.call({ call: "begin", target, body, members: one.numbers }));
      this.shares.push({ ...one, id: data.id });
      return { numbers: one.numbers, data };
    }));
    const members = [];
    for (const { numbers, data } of begun) for (const number of numbers) members[number] = data.members[number];
    return { ...begun[0].data, members };
  }

  async advance(due) {
    const [, took] = await timed(() => Promise.all(this.shares.map(async ({ worker, id, numbers }) => {
      const [[, moment]] = events(await worker.call({ call: "advance", id, due }));
      for (const number of numbers) { this.frames[number] = moment.frames[number]; this.moved[number] = moment.tally.moved[number]; }
      this.step = moment.step;
    })));
    this.cost = smoothed(this.cost, took / due);
    return took;
  }

  end() { for (const { worker, id } of this.shares) worker.call({ call: "end", id }).catch(() => { /* it has ended */ }); }
}

const team = async (path, value, signal, tell) => {
  await loaded;
  const clock = new Clock(value.speed), id = ++begun, body = JSON.stringify(value);
  const { members, classes } = await get(path), early = classes.slice(0, FIRST_CLASSES);
  const of = (wanted) => members.flatMap(({ judge }, number) => (judge.left.concat(judge.right).every((label) => early.includes(label)) === wanted ? [number] : []));
  const parts = [of(true), of(false)].filter((numbers) => numbers.length).map((numbers) => new Part(numbers)), [first, rest] = parts;
  const merged = (values) => members.map((_, number) => parts.map((part) => values(part)[number]).find((value) => value !== undefined) ?? null);
  try {
    const data = await Promise.all(parts.map((part) => part.begin("/" + path, body))), { until } = data[0];
    running.set(id, { change: async (news) => { clock.set(news); return null; } });
    tell("begin", { ...data[0], id, members: members.map((_, number) => data.map((part) => part.members[number]).find(Boolean)) });
    // How far all should be by now, and milliseconds that the first robots have left to the others.
    let goal = 0, left = 0;
    await run(clock, signal, () => goal, async (due) => {
      goal = Math.min(until, goal + due);
      const steps = goal - first.step, took = steps ? await first.advance(steps) : 0;
      clock.took(took, steps);
      if (rest) {
        left = clock.speed && first.step < until ? Math.min(left + TICK - took, LONGEST + rest.cost) : Infinity;
        const fit = Math.min(goal - rest.step, Math.floor(Math.min(left, Math.max(LONGEST, rest.cost)) / rest.cost));
        if (fit > 0) left -= await rest.advance(fit);
      }
      const { worker, id: counted } = first.shares[0];
      const tally = JSON.parse(await worker.call({ call: "tally", id: counted, moved: merged((part) => part.moved) }));
      const behind = rest && rest.step < first.step ? { robots: rest.numbers.length, step: rest.step } : null;
      tell("moment", { step: first.step, frames: merged((part) => part.frames), tally, behind });
      if (parts.some((part) => part.step < until)) return behind ? "behind" : null;
      tell("end", { step: until, tally });
      return "over";
    });
  } finally {
    running.delete(id);
    parts.forEach((part) => part.end());
  }
};

// Walks the pinned walk of the program, and says how near this browser comes.
export const about = async () => {
  const { request, moved } = JSON.parse(new TextDecoder().decode(await bytesOf("pinned.json")));
  let own = null;
  await stream("api/simulations", { ...request, speed: 0 }, new AbortController().signal, (name, data) => { if (name === "end") own = data.answer.moved; });
  const apart = Math.abs(own - moved), steps = request.control_steps, here = "All walks are computed in your browser.";
  return apart === 0
    ? `${here} They are the program's to the last bit, as far as a walk of ${steps} control steps tells.`
    : `${here} After ${steps} control steps a walk is ${apart.toExponential(1)} voxel lengths from the program's, since browsers round products and sums one by one.`;
};
