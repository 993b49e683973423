(async () => {
  const { css, fit } = Drawing;
  const $ = (id) => document.getElementById(id);
  const view = (text) => {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    return new DataView(bytes.buffer);
  };
  const unpack = (text) => new Response(new Blob([view(text)]).stream().pipeThrough(new DecompressionStream("gzip")));
  const given = $("rollout").textContent;
  const rollout = given[0] === "{" ? JSON.parse(given) : await unpack(given).json();
  const P = rollout.points, UNIT = rollout.unit, NOWHERE = -32768;
  // A small page has some moments of the walk, as html.rs packs them: all frames again, points between moments on straight lines.
  const widened = async () => {
    const bytes = new Uint8Array(await unpack(rollout.positions).arrayBuffer()), { steps, phases } = rollout;
    const M = steps.length, width = 2 * P, known = new Int16Array(M * width), centres = view(rollout.origins);
    for (let c = 0; c < width; c++) {
      for (let m = 0, at = 0; m < M; m++) known[m * width + c] = at += bytes[c * M + m] + 256 * bytes[width * M + c * M + m];
    }
    const begins = new Set(phases.map((p) => p.first)), frames = [], all = [];
    steps.forEach((step, m) => {
      const k = frames.length, goesOn = m + 1 < M && !begins.has(m + 1), length = goesOn ? steps[m + 1] - step : 1;
      phases.forEach((p) => { if (p.first === m) p.begin = k; });
      for (let s = 0; s < length; s++) { frames.push([m, s / length]); all.push(step + s); }
    });
    phases.forEach((p) => { p.first = p.begin; });
    rollout.steps = all;
    const places = new Int16Array(all.length * width), origins = new Float64Array(2 * all.length);
    frames.forEach(([m, t], f) => {
      const mix = (a, b) => (t ? a * (1 - t) + b * t : a);
      for (let k = 0; k < 2; k++) origins[2 * f + k] = mix(centres.getFloat64(16 * m + 8 * k, true), t && centres.getFloat64(16 * m + 16 + 8 * k, true));
      for (let c = 0; c < width; c++) {
        const a = known[m * width + c], b = t ? known[(m + 1) * width + c] : a;
        places[f * width + c] = a === NOWHERE || b === NOWHERE ? NOWHERE : Math.round(mix(a, b));
      }
    });
    return [places, origins].map((numbers) => new DataView(numbers.buffer));
  };
  const [positions, origins] = rollout.small ? await widened() : [view(rollout.positions), view(rollout.origins)];
  const N = rollout.steps.length;
  const origin = (f, k) => origins.getFloat64(16 * f + 8 * k, true);
  // A point in voxel lengths, or null where the simulation had lost it.
  const point = (f, i) => {
    const at = 4 * (f * P + i), x = positions.getInt16(at, true);
    return x === NOWHERE ? null : [x / UNIT + origin(f, 0), positions.getInt16(at + 2, true) / UNIT + origin(f, 1)];
  };
  const rows = rollout.body.split("\n");

  // Phases and rollouts (a rollout goes from one reset to the next).
  const phases = rollout.phases;
  const end = (p) => (p + 1 < phases.length ? phases[p + 1].first : N);
  const phaseOf = (f) => { let p = phases.length - 1; while (p > 0 && phases[p].first > f) p--; return p; };
  const rolloutOf = (f) => {
    let a = phaseOf(f), b = a + 1;
    while (a > 0 && !phases[a].fresh) a--;
    while (b < phases.length && !phases[b].fresh) b++;
    return [phases[a].first, end(b - 1)];
  };
  const stepsIn = (p) => {
    const goesOn = p + 1 < phases.length && !phases[p + 1].fresh;
    return rollout.steps[goesOn ? end(p) : end(p) - 1] - rollout.steps[phases[p].first];
  };
  const names = Drawing.classNames(rollout.class_names);
  // As task/answer.rs has it.
  const verdict = (p, d, over) => {
    if (!rollout.judge) return "";
    const says = Math.abs(d) > rollout.threshold ? (d < 0 ? rollout.judge.left : rollout.judge.right) : [];
    if (!says.length) return over ? "undecided" : "";
    const known = over && [...rollout.judge.left, ...rollout.judge.right].includes(phases[p].class);
    return "says " + says.map(names.name).join(" or ") + (known ? (says.includes(phases[p].class) ? ": correct" : ": wrong") : "");
  };
  $("answers").hidden = $("verdict").hidden = !rollout.judge;
  const moved = (f) => origin(f, 0) - origin(phases[phaseOf(f)].first, 0);
  const signed = (d) => {
    if (!Number.isFinite(d)) return "?";
    const t = Math.abs(d) < 1e5 ? Math.abs(d).toFixed(2) : Math.abs(d).toExponential(1);
    return Number(t) === 0 ? "0.00" : (d < 0 ? "−" : "+") + t;
  };

  // What the whole walk needs, and a smooth path for the camera where that does not fit. Parts that are flung off do not count.
  const extents = Array.from({ length: N }, (_, f) => {
    const { left, right, top, bottom } = Drawing.extent(Array.from({ length: P }, (_, i) => point(f, i)));
    return { left, right, top, bottom };
  });
  const terrain = rollout.terrain || [], BELOW = 2;
  const standing = Math.max(1, extents[0].top), size = Math.max(1, extents[0].right - extents[0].left);
  for (const [f, e] of extents.entries()) { const x = origin(f, 0); e.left = Math.max(e.left, x - size); e.right = Math.min(e.right, x + size); }
  let low = Infinity, high = -Infinity, top = 0, lowest = Infinity;
  for (const e of extents) { low = Math.min(low, e.left); high = Math.max(high, e.right); top = Math.max(top, e.top); lowest = Math.min(lowest, e.bottom); }
  const left = low - 2.5, right = high + 2.5;
  const averaged = (axis) => {
    const path = new Float64Array(N);
    for (let f = 0; f < N;) {
      const [a, b] = rolloutOf(f);
      let line = Array.from({ length: b - a }, (_, i) => origin(a + i, axis));
      for (let pass = 0; pass < 2; pass++) {
        const sums = [0];
        for (const x of line) sums.push(sums[sums.length - 1] + x);
        line = line.map((_, i) => { const r = Math.min(50, i, line.length - 1 - i); return (sums[i + r + 1] - sums[i - r]) / (2 * r + 1); });
      }
      path.set(line, a);
      f = Math.max(b, f + 1);
    }
    return path;
  };
  const path = averaged(0);
  // The lowest height in the picture of a frame. On terrain it follows a body that climbs or falls, as stage.rs has it.
  let floor = () => 0;
  if (!terrain.length) top = Math.min(Math.max(top + 1, standing + 1.5), 2 * standing + 2);
  else {
    const tall = Math.max(1, extents[0].top - extents[0].bottom), climbed = top - lowest + BELOW + 1, most = 2 * tall + BELOW + 4, heights = averaged(1);
    floor = climbed <= most ? () => Math.max(lowest - BELOW, 0)
      : (f) => Math.max(heights[f] - most / 2, Math.min(extents[f].top, origin(f, 1) + most / 2) + 1 - most, 0);
    top = Math.min(Math.max(climbed, tall + BELOW + 1.5), most);
  }

  let frame = 0;
  // All rollouts at once: `frame` goes through the longest one.
  let together = false;
  const GAP = 8, SEEN = 36, NARROW = 420;
  const isFresh = phases.length > 1 && phases.every((p) => p.fresh);
  const longest = phases.reduce((most, p, k) => (end(k) - p.first > end(most) - phases[most].first ? k : most), 0);
  const firstFrame = () => (together ? phases[longest].first : 0), lastFrame = () => (together ? end(longest) : N) - 1;
  const frames = () => (together ? phases.map((p, k) => Math.min(p.first + frame - firstFrame(), end(k) - 1)) : [frame]);
  const body = { voxels: rollout.voxels, sides: Drawing.sidesOf(rollout.voxels, P), areas: rollout.materials.areas, materials: rollout.materials.list };

  const drawWorld = () => {
    const canvas = $("world"), whole = canvas.parentElement.clientWidth - 24, groundHeight = 30, band = together ? SEEN + 4 : 0;
    const columns = together && whole > NARROW ? Math.ceil(Math.sqrt(phases.length)) : 1, across = Math.ceil(frames().length / columns);
    const width = (whole - (columns - 1) * GAP) / columns;
    const fitting = width / (right - left), tallest = Math.min(1.1 * width, 620) / top;
    const follow = fitting < Math.min(7, tallest);
    const scale = Math.min(follow ? width / (1.7 * size + 8) : fitting, tallest, 34);
    const surface = Math.round(top * scale) + band, height = surface + groundHeight;
    const ctx = fit(canvas, whole, across * (height + GAP) - GAP);
    ctx.clearRect(0, 0, whole, across * (height + GAP));
    frames().forEach((f, k) => {
      ctx.save();
      ctx.translate((k % columns) * (width + GAP), Math.floor(k / columns) * (height + GAP));
      ctx.beginPath(); ctx.rect(0, 0, width, height); ctx.clip();
      drawScene(ctx, f, { width, height, surface, scale, follow });
      if (together) drawSeen(ctx, f);
      ctx.restore();
    });
  };

  const drawScene = (ctx, frame, { width, height, surface, scale, follow }) => {
    // The camera never loses a body that is hurled away.
    const middle = follow ? Drawing.camera(path[frame], extents[frame], width / scale, 1) : (left + right) / 2;
    const x0 = middle - width / 2 / scale;
    const X = (x) => Math.min(Math.max((x - x0) * scale, -9999), 9999);
    const base = floor(frame);
    const Y = (y) => Math.min(Math.max(surface - (y - base) * scale, -9999), 9999);
    ctx.fillStyle = css("sky"); ctx.fillRect(0, 0, width, height);
    ctx.fillStyle = css("ground"); ctx.fillRect(0, Y(0), width, height - Y(0));
    const [first] = rolloutOf(frame), zero = origin(first, 0), begin = origin(phases[phaseOf(frame)].first, 0);
    ctx.strokeStyle = css("mark"); ctx.lineWidth = 1; ctx.setLineDash([5, 5]);
    for (const x of begin === zero ? [zero] : [zero, begin]) { ctx.beginPath(); ctx.moveTo(X(x), 0); ctx.lineTo(X(x), Y(0)); ctx.stroke(); }
    ctx.setLineDash([]);
    Drawing.ruler(ctx, { x0, zero, X, scale, width, surface: Y(0) });
    const seen = { columns: [x0, x0 + width / scale], rows: [base - (height - surface) / scale, base + surface / scale] };
    for (const object of terrain) Drawing.terrain(ctx, object, seen, { X, Y, scale });
    Drawing.robot(ctx, { ...body, points: Array.from({ length: P }, (_, i) => point(frame, i)) }, { X, Y, scale });
    Drawing.path(ctx, Array.from({ length: frame - first + 1 }, (_, i) => [origin(first + i, 0), origin(first + i, 1)]), { X, Y });
  };

  const images = phases.map((p) => view(p.stimulus));
  const drawStimulus = () => {
    const canvas = $("stimulus"), p = phaseOf(frame), { height, width, image } = phases[p];
    $("whole-figure").hidden = !image;
    if (image) {
      const { pixels, margin } = image;
      Drawing.framed($("whole"), $("whole-figure").clientWidth, { height: pixels.length, width: pixels[0].length, grey: (r, c) => pixels[r][c], margin });
    }
    const grey = (r, c) => images[p].getUint8(r * width + c);
    Drawing.stimulus(canvas, canvas.parentElement.clientWidth, { height, width, grey }, rows, rollout.materials.list);
  };

  const gutter = 52;
  // In a corner the image, if the sensors see a part of it, and what they see; its name, and how far the robot has moved.
  const drawSeen = (ctx, f) => {
    const p = phaseOf(f), { height, width, image } = phases[p];
    let x = 4;
    const picture = (height, width, grey, margin) => {
      const side = SEEN / Math.max(height, width), edge = (k) => Math.round(k * side);
      for (let r = 0; r < height; r++) for (let c = 0; c < width; c++) {
        const v = grey(r, c);
        ctx.fillStyle = `rgb(${v}, ${v}, ${v})`; ctx.fillRect(x + edge(c), 4 + edge(r), edge(c + 1) - edge(c), edge(r + 1) - edge(r));
      }
      ctx.strokeStyle = css("faint"); ctx.lineWidth = 1; ctx.strokeRect(x, 4, edge(width), edge(height));
      if (margin) Drawing.frame(ctx, margin.map(edge), [x, 4, edge(width), edge(height)]);
      x += edge(width) + 6;
    };
    if (image) picture(image.pixels.length, image.pixels[0].length, (r, c) => image.pixels[r][c], image.margin);
    picture(height, width, (r, c) => images[p].getUint8(r * width + c));
    ctx.textBaseline = "top"; ctx.textAlign = "left"; ctx.font = "13px system-ui, sans-serif";
    ctx.fillStyle = css("ink"); ctx.fillText(phases[p].label, x + 2, 4);
    ctx.fillStyle = css("accent"); ctx.fillText(signed(moved(f)), x + 2, 22);
  };

  const drawChart = () => {
    const canvas = $("chart"), width = canvas.parentElement.clientWidth - 24, height = 92, bottom = height - 4;
    const ctx = fit(canvas, width, height);
    ctx.clearRect(0, 0, width, height);
    let lo = Infinity, hi = -Infinity;
    for (let f = 0; f < N; f++) { const d = origin(f, 0) - origin(rolloutOf.cache[f], 0); lo = Math.min(lo, d); hi = Math.max(hi, d); }
    const pad = Math.max(0.5, (hi - lo) * 0.08); lo -= pad; hi += pad;
    const X = (f) => gutter + (width - gutter - 6) * (N > 1 ? f / (N - 1) : 0);
    const Y = (d) => 18 + (bottom - 18) * (hi - d) / (hi - lo);
    ctx.font = "11px system-ui, sans-serif"; ctx.textBaseline = "middle"; ctx.textAlign = "right";
    const marks = [0, lo + pad, hi - pad].filter((d, k, all) => k === 0 || Math.abs(Y(d) - Y(0)) > 12);
    for (const d of marks) {
      ctx.strokeStyle = css("line"); ctx.lineWidth = 1;
      ctx.beginPath(); ctx.moveTo(gutter, Y(d)); ctx.lineTo(width - 6, Y(d)); ctx.stroke();
      ctx.fillStyle = css("faint"); ctx.fillText(Math.abs(d) < 1e4 ? signed(d).replace(/\.?0+$/, "") || "0" : signed(d), gutter - 6, Y(d));
    }
    ctx.textAlign = "left"; ctx.textBaseline = "top";
    phases.forEach((p, k) => {
      ctx.strokeStyle = css("mark"); ctx.setLineDash([4, 4]);
      if (k > 0) { ctx.beginPath(); ctx.moveTo(X(p.first), 0); ctx.lineTo(X(p.first), bottom); ctx.stroke(); }
      ctx.setLineDash([]);
      const room = X(end(k)) - X(p.first) - 8;
      let text = p.label;
      while (text.length > 1 && ctx.measureText(text).width > room) text = text.slice(0, -1);
      ctx.fillStyle = css("faint"); ctx.fillText(text, X(p.first) + 5, 1);
    });
    ctx.strokeStyle = css("accent"); ctx.lineWidth = 1.8; ctx.lineJoin = "round"; ctx.beginPath();
    for (let f = 0; f < N; f++) {
      const first = rolloutOf.cache[f], y = Y(origin(f, 0) - origin(first, 0));
      if (f === first) ctx.moveTo(X(f), y); else ctx.lineTo(X(f), y);
    }
    ctx.stroke();
    for (const f of frames()) {
      ctx.strokeStyle = css("ink"); ctx.lineWidth = 1;
      ctx.beginPath(); ctx.moveTo(X(f), 16); ctx.lineTo(X(f), bottom); ctx.stroke();
      ctx.fillStyle = css("accent"); ctx.beginPath();
      ctx.arc(X(f), Y(origin(f, 0) - origin(rolloutOf.cache[f], 0)), 4, 0, 7); ctx.fill();
    }
  };
  rolloutOf.cache = Array.from({ length: N }, (_, f) => rolloutOf(f)[0]);

  const draw = () => {
    const p = phaseOf(frame), step = rollout.steps[frame] - rollout.steps[phases[p].first], d = moved(frame);
    $("label").textContent = phases[p].label;
    $("step").textContent = `${step} of ${stepsIn(p)}`;
    $("cycle").textContent = (step / rollout.cycle).toFixed(1);
    $("moved").textContent = (Math.abs(d) < 0.005 ? "" : d < 0 ? "← " : "→ ") + signed(d);
    $("verdict").textContent = verdict(p, d, frame === N - 1 || phaseOf(frame + 1) !== p);
    $("time").value = frame;
    $("time").setAttribute("aria-valuetext", `${together ? "" : `${phases[p].label}, `}step ${step} of ${stepsIn(p)}`);
    const walks = frames().map((f) => `sees ${phases[phaseOf(f)].label}, moved ${signed(moved(f))} voxel lengths`);
    $("world").setAttribute("aria-label", `Step ${step}. The robot ${walks.join("; ")}`);
    $("stimulus").setAttribute("aria-label", `The image as the sensors see it: ${phases[p].label}`);
    [...$("phases").children].forEach((b, k) => b.setAttribute("aria-pressed", String(together ? k === phases.length : k === p)));
    for (const seen of document.querySelectorAll(".seen")) seen.hidden = together;
    drawWorld(); drawStimulus(); drawChart();
  };
  const show = (f) => { frame = Math.min(Math.max(Math.round(f), firstFrame()), lastFrame()); draw(); };

  // Playing: 50 control steps a second at speed 1.
  let playing = false, clock = 0, at = 0, speed = 1;
  const tick = (now) => {
    if (!playing) return;
    at += Math.min(now - clock, 100) / 1000 * 50 * speed; clock = now;
    let f = frame;
    while (f < lastFrame() && rollout.steps[f + 1] <= at) f++;
    if (f !== frame) show(f);
    if (f >= lastFrame()) { play(false); return; }
    requestAnimationFrame(tick);
  };
  const play = (on) => {
    playing = on && N > 1;
    $("play").textContent = playing ? "Pause" : "Play";
    if (!playing) return;
    if (frame >= lastFrame()) show(firstFrame());
    at = rollout.steps[frame]; clock = performance.now();
    requestAnimationFrame(tick);
  };
  const seek = (f) => { show(f); at = rollout.steps[frame]; };
  const halt = (f) => { play(false); seek(f); };

  const arrange = (on) => {
    together = on;
    $("time").min = firstFrame(); $("time").max = lastFrame();
  };
  arrange(false);
  $("play").onclick = () => play(!playing);
  $("back").onclick = () => halt(frame - 1);
  $("next").onclick = () => halt(frame + 1);
  $("time").oninput = (e) => seek(Number(e.target.value));
  for (const s of [0.1, 0.25, 0.5, 1, 2, 4, 8]) $("speed").add(new Option(s + " ×", s, s === 1, s === 1));
  $("speed").onchange = (e) => { speed = Number(e.target.value); };
  phases.forEach((p, k) => {
    const button = document.createElement("button"), far = document.createElement("span");
    button.type = "button"; button.textContent = p.label; far.textContent = signed(p.displacement ?? NaN);
    button.append(far); button.onclick = () => { arrange(false); seek(p.first); }; $("phases").append(button);
  });
  if (isFresh) {
    const button = document.createElement("button");
    button.type = "button"; button.textContent = "Side by side";
    button.onclick = () => { arrange(true); seek(firstFrame()); if (!playing) play(true); }; $("phases").append(button);
  }
  const used = new Set(rollout.voxels.map(([m]) => m));
  // A body that only targets drive (materials 7 and 8) sees nothing.
  $("stimulus").parentElement.hidden = (used.has(7) || used.has(8)) && ![...used].some((m) => rollout.materials.list[m].sensor);
  rollout.materials.list.forEach((m, k) => {
    if (!used.has(k)) return;
    const item = document.createElement("li");
    item.append(Drawing.swatch(m), m.name); $("legend").append(item);
  });
  const drag = (e) => {
    if (e.type === "pointermove" && !e.buttons) return;
    const box = $("chart").getBoundingClientRect();
    const f = Math.min(Math.max(Math.round((e.clientX - box.left - gutter) / (box.width - gutter - 6) * (N - 1)), 0), N - 1);
    seek(together ? firstFrame() + f - phases[phaseOf(f)].first : f);
  };
  $("chart").addEventListener("pointerdown", drag);
  $("chart").addEventListener("pointermove", drag);
  document.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || e.target.matches("select")) return;
    const slider = e.target === $("time");
    if (e.key === " " && !e.target.matches("button")) play(!playing);
    else if (e.key === "ArrowLeft" && !slider) halt(frame - 1);
    else if (e.key === "ArrowRight" && !slider) halt(frame + 1);
    else if (e.key === "Home" && !slider) seek(firstFrame());
    else if (e.key === "End" && !slider) seek(lastFrame());
    else if (e.key >= "1" && e.key <= "9" && phases[Number(e.key) - 1]) { arrange(false); seek(phases[Number(e.key) - 1].first); }
    else return;
    e.preventDefault();
  });
  window.addEventListener("resize", draw);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  // "#260" opens the page at frame 260, paused.
  const asked = /^#(\d+)$/.exec(location.hash);
  show(asked ? Number(asked[1]) : 0);
  if (!asked && !window.matchMedia("(prefers-reduced-motion: reduce)").matches) play(true);
})();
