/** How the page speaks with the server: three ways, all with the token of this run. */

const token = document.querySelector('meta[name="dsfab-token"]').content;
const headers = { 'X-Dsfab-Token': token };

/** The answer to a question, as an object; throws an Error with the server's own sentence. */
export async function post(path, body) {
  const answer = await fetch(path, {
    method: 'POST',
    headers: { ...headers, 'Content-Type': 'application/json' },
    body: JSON.stringify(body),
  });
  return read(answer);
}

/** What is at a path, as an object. */
export async function get(path) {
  return read(await fetch(path, { headers }));
}

async function read(answer) {
  const told = await answer.json();
  if (!answer.ok) throw new Error(told.error ?? `the server answers ${answer.status}`);
  return told;
}

/** What was last solved: facts, and arrays by name. `have` is the version that the page holds already. */
export async function model(have) {
  const answer = await fetch(`/api/model?have=${have}`, { headers });
  if (!answer.ok) return read(answer);
  return unpacked(await answer.arrayBuffer());
}

const KINDS = { float32: Float32Array, uint32: Uint32Array, uint8: Uint8Array };

/** See payload.py for how it is packed. */
export function unpacked(buffer) {
  const long = new DataView(buffer).getUint32(0, true);
  const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, long)));
  const arrays = {};
  for (const [name, { type, shape, at }] of Object.entries(facts.arrays)) {
    arrays[name] = new KINDS[type](buffer, 4 + long + at, shape.reduce((a, b) => a * b, 1));
  }
  return { facts, arrays };
}

/** Call `hear` with every piece of news of a job; `lost` with whether the server is away. */
export function listen(hear, lost) {
  const source = new EventSource(`/api/events?token=${encodeURIComponent(token)}`);
  source.onmessage = (event) => hear(JSON.parse(event.data));
  source.onopen = () => lost(false);
  source.onerror = () => lost(true);
  return new Promise((done) => source.addEventListener('open', done, { once: true }));
}

/** The address of a built file. */
export function address(build, index) {
  return `/api/file?build=${build}&index=${index}&token=${encodeURIComponent(token)}`;
}

/** Give the person a file of text. */
export function download(name, text) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([text], { type: 'application/toml' }));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}

/** A file as base64. */
export async function base64(file) {
  const bytes = new Uint8Array(await file.arrayBuffer());
  let text = '';
  for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
  return btoa(text);
}
