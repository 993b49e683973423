// A worker with the simulator: one call, one answer.

let simulator = null;

const answer = (message) => {
  const text = new TextEncoder().encode(JSON.stringify(message));
  // Room may move the module's memory, so it is looked at only then.
  const at = simulator.room(text.length);
  new Uint8Array(simulator.memory.buffer, at, text.length).set(text);
  const status = simulator.call();
  const output = new Uint8Array(simulator.memory.buffer, simulator.output(), simulator.output_length());
  return { status, text: new TextDecoder().decode(output) };
};

onmessage = async ({ data }) => {
  try {
    if (!data.module) return postMessage(answer(data));
    simulator = (await WebAssembly.instantiate(data.module, {})).exports;
    postMessage({ status: 204, text: "" });
  } catch (error) {
    postMessage({ status: 500, text: `the simulator stopped: ${error.message}` });
  }
};
