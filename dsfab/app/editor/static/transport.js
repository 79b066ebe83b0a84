/** Requests of the page to its server, with the token of this run. transport_notebook.js replaces it in a notebook. */

import { unpacked } from './bytes.js';
import { fromHash } from './state.js';

const token = document.querySelector('meta[name="dsfab-token"]').content;
const headers = { 'X-Dsfab-Token': token };

export const AWAY = 'The server is away; start dsfab edit again.';

/** Send a request of page.py and return the answer; throws an Error with the server's message. */
export async function post(name, body) {
  const answer = await fetch(`/api/${name}`, {
    method: 'POST',
    headers: { ...headers, 'Content-Type': 'application/json' },
    body: JSON.stringify(body),
  });
  return read(answer);
}

const [start, first] = window.early; // index.html requests it before any module loads

/** Facts that the page needs before the first model. */
export const begun = async () => read(await start);

/** The model that was solved before the page loaded, as from `model`, or null. */
export const early = first
  .then(async (answer) => (answer.status === 200 ? unpacked(await answer.arrayBuffer()) : null))
  .catch(() => null);

async function read(answer) {
  const told = await answer.json();
  if (!answer.ok) throw new Error(told.error ?? `the server answers ${answer.status}`);
  return told;
}

/** The last model: facts, and arrays by name. `have`: version that the page has already, or 0. */
export async function model(have) {
  const known = have ? null : await early; // avoids a second download of large arrays
  const answer = await fetch(`/api/model?have=${known?.facts.version ?? have}`, { headers });
  if (!answer.ok) return read(answer);
  const { facts, arrays } = unpacked(await answer.arrayBuffer());
  if (!known || facts.whole) return { facts, arrays };
  return { facts: { ...known.facts, ...facts, whole: true }, arrays: { ...known.arrays, ...arrays } };
}

/** The cut sheet of a draft, or null if another draft has followed. */
export async function cut(draft) {
  const answer = await fetch(`/api/cut?draft=${draft}`, { headers });
  if (!answer.ok) return read(answer);
  return answer.status === 200 ? unpacked(await answer.arrayBuffer()) : null;
}

/** Call `hear` with every record of a job, and `lost` with whether the connection is lost. */
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

/** State of an earlier visit to the preset that `start` opens: { changes, view }, from the address. */
export function kept(start) {
  const { title, changes, view } = fromHash(location.hash);
  return title === start.title ? { changes, view } : { changes: {}, view: {} };
}

/** Store the state for a reload or a bookmark. */
export function keep(state, title) {
  history.replaceState(null, '', state.hash(title));
}

/** Nothing else changes the preset here. */
export function follow() {}
