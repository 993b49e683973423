// The engine of `morphcog serve`: the server answers. Errors carry its one line.

const fail = async (response) => {
  const line = (await response.text()).trim();
  throw Object.assign(new Error(line || response.statusText), { status: response.status });
};

export const get = async (path) => {
  const response = await fetch(path);
  return response.ok ? response.json() : fail(response);
};

export const post = async (path, value, signal) => {
  const body = typeof value === "string" ? value : JSON.stringify(value);
  const response = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body, signal });
  if (!response.ok) return fail(response);
  return response.status === 204 ? null : response.json();
};

// Server-sent events in the answer to a POST (EventSource can only GET): one request begins a simulation, and to drop it ends
// that simulation. Jupyter's proxy hands on events as they come only where they are asked for by this Accept.
export const stream = async (path, value, signal, tell) => {
  const headers = { "Content-Type": "application/json", Accept: "text/event-stream" };
  const response = await fetch(path, { method: "POST", headers, body: JSON.stringify(value), signal });
  if (!response.ok) return fail(response);
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { done, value: piece } = await reader.read();
    if (done) return;
    const events = (rest + piece).split("\n\n");
    rest = events.pop();
    for (const event of events) {
      const name = /^event: (.*)$/m.exec(event), data = /^data: (.*)$/m.exec(event);
      if (name && data) tell(name[1], JSON.parse(data[1]));
    }
  }
};

// What there is to say of this engine: nothing, it is the program itself.
export const about = async () => null;
