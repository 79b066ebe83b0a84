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

const [start, first] = window.early; // asked for by index.html, before any module is here

/** What the page needs before anything is solved. */
export const begun = async () => read(await start);

/** What was solved before the page came, as `model` gives it, or null. */
export const early = first
  .then(async (answer) => (answer.status === 200 ? unpacked(await answer.arrayBuffer()) : null))
  .catch(() => null);

async function read(answer) {
  const told = await answer.json();
  if (!answer.ok) throw new Error(told.error ?? `the server answers ${answer.status}`);
  return told;
}

/** What was last solved: facts, and arrays by name. `have` is the version that the page holds already, or 0. */
export async function model(have) {
  const known = have ? null : await early; // nothing large comes twice
  const answer = await fetch(`/api/model?have=${known?.facts.version ?? have}`, { headers });
  if (!answer.ok) return read(answer);
  const { facts, arrays } = unpacked(await answer.arrayBuffer());
  if (!known || facts.whole) return { facts, arrays };
  return { facts: { ...known.facts, ...facts, whole: true }, arrays: { ...known.arrays, ...arrays } };
}

/** The sheet that a draft was cut to, or null where another draft has followed. */
export async function cut(draft) {
  const answer = await fetch(`/api/cut?draft=${draft}`, { headers });
  if (!answer.ok) return read(answer);
  return answer.status === 200 ? unpacked(await answer.arrayBuffer()) : null;
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
