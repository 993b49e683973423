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
  const [module, gallery] = await Promise.all([bytesOf("simulator.gz").then((bytes) => WebAssembly.compile(bytes)), bytesOf("gallery.gz").then((bytes) => new TextDecoder().decode(bytes))]);
  return { module, gallery };
})();
loaded.catch(() => { /* whoever asks hears of it */ });

// A worker, which answers one call after the other.
class Hand {
  constructor() {
    this.waiting = [];
    this.busy = 0;
    this.worker = new Worker("worker.js");
    this.worker.onmessage = ({ data }) => this.waiting.shift().resolve(data);
    this.worker.onerror = (event) => { for (const one of this.waiting.splice(0)) one.reject(failed(500, event.message || "a worker could not start")); };
    this.ready = loaded.then(({ module, gallery }) => this.send({ module }).then(() => this.send({ call: "open", gallery }))).then(checked);
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

export const get = async (path) => {
  const answer = JSON.parse(await hand(0).call({ call: "answer", method: "GET", target: "/" + path, body: "" }));
  return path === "api/status" ? { ...answer, simulations: running.size, max_simulations: CORES } : answer;
};

export const post = async (path, value) => {
  const body = typeof value === "string" ? value : JSON.stringify(value), of = /^api\/simulations\/(\d+)$/.exec(path);
  if (of) {
    const simulation = running.get(Number(of[1]));
    if (!simulation) throw failed(404, "the simulation has ended");
    return simulation.change(value);
  }
  const text = await hand(0).call({ call: "answer", method: "POST", target: "/" + path, body });
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
  took(milliseconds, steps) { if (steps) this.cost = 0.7 * this.cost + 0.3 * milliseconds / steps; }
}

const sleep = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
// Nobody looks at a hidden tab, so nothing is computed for it.
const seen = async () => {
  while (document.hidden) await new Promise((resolve) => document.addEventListener("visibilitychange", resolve, { once: true }));
};

// Advances a simulation at its pace until it ends or is dropped. `advance` returns true at the end.
const run = async (clock, signal, step, advance) => {
  for (;;) {
    if (document.hidden) { await seen(); clock.begin = null; }
    if (signal.aborted) throw new DOMException("dropped", "AbortError");
    const due = clock.paused ? 0 : clock.due(step());
    if (due) {
      const before = performance.now();
      if (await advance(due)) return;
      clock.took(performance.now() - before, due);
    }
    // A message to itself gives the page time to draw.
    await sleep(due && !clock.speed ? 0 : TICK);
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
    const first = events(await own.call({ call: "begin", target: "/" + path, body: JSON.stringify(value), share: [0, 1] }));
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
    await run(clock, signal, () => step, async (due) => events(await own.call({ call: "advance", id: inner, due })).map(hear).some(Boolean));
  } finally {
    running.delete(id);
    own.busy--;
    if (inner !== null) own.call({ call: "end", id: inner }).catch(() => { /* it has ended */ });
  }
};

// A team's robots are shared out among all workers; the votes are counted where the first of them walks.
const team = async (path, value, signal, tell) => {
  await loaded;
  const workers = all(), clock = new Clock(value.speed), id = ++begun, body = JSON.stringify(value);
  let parts = [], step = 0, until = 0;
  const of = (number) => number % workers.length;
  try {
    parts = await Promise.all(workers.map(async (worker, share) => {
      const [[, data]] = events(await worker.call({ call: "begin", target: "/" + path, body, share: [share, workers.length] }));
      return { worker, inner: data.id, data };
    }));
    running.set(id, { change: async (news) => { clock.set(news); return null; } });
    const { data } = parts[0];
    until = data.until;
    tell("begin", { ...data, id, members: data.members.map((_, number) => parts[of(number)].data.members[number]) });
    await run(clock, signal, () => step, async (due) => {
      const moments = await Promise.all(parts.map(async ({ worker, inner }) => events(await worker.call({ call: "advance", id: inner, due }))[0][1]));
      const merged = (values) => values(moments[0]).map((_, number) => values(moments[of(number)])[number]);
      step = moments[0].step;
      const moved = merged((moment) => moment.tally.moved), frames = merged((moment) => moment.frames);
      const tally = JSON.parse(await parts[0].worker.call({ call: "tally", id: parts[0].inner, moved }));
      tell("moment", { step, frames, tally });
      if (step < until) return false;
      tell("end", { step, tally });
      return true;
    });
  } finally {
    running.delete(id);
    for (const { worker, inner } of parts) worker.call({ call: "end", id: inner }).catch(() => { /* it has ended */ });
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
