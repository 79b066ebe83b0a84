/** Replacement of transport.js in a notebook: messages of anywidget's model instead of HTTP. */

import { download, unpacked } from './bytes.js';

const { model: widget } = window.frameElement.dsfab; // widget.js puts it there
const PATIENCE = 4000; // milliseconds without an answer until the page shows a notice

export const AWAY = 'Python does not answer: it is busy with another cell, or was restarted.';

const own = Math.random().toString(36).slice(2); // distinguishes this page from other views of the same widget
const asked = new Map();
let [number, hear, lost] = [0, () => {}, () => {}];

function received(told, buffers) {
  if (told.news) hear(told.news);
  const waiting = asked.get(told.answer);
  if (!waiting) return;
  asked.delete(told.answer);
  clearTimeout(waiting.late);
  lost(false);
  if (told.error === undefined) waiting.done(buffers?.length ? whole(buffers[0]) : told.told);
  else waiting.failed(new Error(told.error));
}

/** A copy of the bytes of a DataView, because arrays must begin at whole words. */
const whole = (view) => view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength);

function ask(name, given = {}) {
  number += 1;
  const ask = `${own}-${number}`;
  return new Promise((done, failed) => {
    asked.set(ask, { done, failed, late: setTimeout(() => lost(true), PATIENCE) });
    widget.send({ ask, name, given });
  });
}

widget.on('msg:custom', received);
window.addEventListener('pagehide', () => {
  widget.off('msg:custom', received);
  widget.off('change:changes', heard);
});

export const post = ask;
export const early = Promise.resolve(null); // because Python could do nothing else while it waits
export const begun = () => ask('start');
export const model = async (have) => unpacked(await ask('model', { have }));

export async function cut(draft) {
  const got = await ask('cut', { draft });
  return got.byteLength ? unpacked(got) : null;
}

export function listen(news, away) {
  [hear, lost] = [news, away];
  return Promise.resolve();
}

export function lead(link, build, index) {
  link.href = '#';
  link.addEventListener('click', async (event) => {
    event.preventDefault();
    download(link.download, await ask('file', { build, index }));
  });
}

export const kept = () => ({ changes: widget.get('changes'), view: widget.get('view') });

export function keep(state) {
  widget.set('changes', state.changes);
  widget.set('view', state.view);
  widget.save_changes();
}

let heard = () => {};

/** Call `hear` with the changes that Python sets. */
export function follow(hear) {
  heard = () => hear(widget.get('changes'));
  widget.on('change:changes', heard);
}
