/** Messages of the page: notes on the design, a notice, and a sign that the picture is outdated. */

import { make } from './controls.js';

const by = (id) => document.getElementById(id);

/** Show the figures paler while they are outdated. */
export function outdated(yes) {
  by('picture').classList.toggle('outdated', yes);
}

/** Show the notes of all stages. */
export function notes(list) {
  by('notes-box').hidden = !list.length;
  by('note-count').textContent = list.length;
  by('notes').replaceChildren(...list.map((textContent) => make('li', { textContent })));
}

/** Show the reason why a build of the current design is refused. */
export function refused(text) {
  by('refused').textContent = text ? `Build refuses this: ${text}` : '';
  by('refused').hidden = !text;
}

/** Show the decisions for a mesh, each with the key that changes it. */
export function decisions(list) {
  by('decided-box').hidden = !list.length;
  by('decided').replaceChildren(...list.flatMap(({ topic, choice, change }) => [
    make('dt', { textContent: topic }), make('dd', { textContent: choice, title: change ? `change ${change}` : '' }),
  ]));
}

/** Show a notice over the picture, which stays. calm: it is no error. */
export function notice(text, calm) {
  by('notice').textContent = text;
  by('notice').hidden = !text;
  by('notice').classList.toggle('calm', calm);
}
