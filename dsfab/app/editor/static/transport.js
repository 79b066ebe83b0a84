/** How the page speaks with its server, with the token of this run. transport_notebook.js does the same in a notebook. */

import { unpacked } from './bytes.js';
import { fromHash } from './state.js';

const token = document.querySelector('meta[name="dsfab-token"]').content;
const headers = { 'X-Dsfab-Token': token };

export const AWAY = 'The server is away; start dsfab edit again.';

/** The answer to a question of asks.py, as an object; throws an Error with the server's own sentence. */
export async function post(name, body) {
  const answer = await fetch(`/api/${name}`, {
    method: 'POST',
    headers: { ...headers, 'Content-Type': 'application/json' },
    body: JSON.stringify(body),
  });
  return read(answer);
}

/** What the page needs before anything is solved. */
export async function begun() {
  return read(await fetch('/api/start', { headers }));
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

/** Call `hear` with every piece of news of a job; `lost` with whether the server is away. */
export function listen(hear, lost) {
  const source = new EventSource(`/api/events?token=${encodeURIComponent(token)}`);
  source.onmessage = (event) => hear(JSON.parse(event.data));
  source.onopen = () => lost(false);
  source.onerror = () => lost(true);
  return new Promise((done) => source.addEventListener('open', done, { once: true }));
}

/** Make a link lead to a built file. */
export function lead(link, build, index) {
  link.href = `/api/file?build=${build}&index=${index}&token=${encodeURIComponent(token)}`;
}

/** What was kept of an earlier visit to the preset that `start` opens: { changes, view }. The address keeps it. */
export function kept(start) {
  const { title, changes, view } = fromHash(location.hash);
  return title === start.title ? { changes, view } : { changes: {}, view: {} };
}

/** Keep the state for a reload or a bookmark. */
export function keep(state, title) {
  history.replaceState(null, '', state.hash(title));
}

/** Nobody else changes the preset here. */
export function follow() {}
