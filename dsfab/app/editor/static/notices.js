/** What the page tells the person: notes on what was solved, a notice, and that the picture is not of now. */

import { make } from './controls.js';

const by = (id) => document.getElementById(id);

/** Of another moment than the sliders: paler. */
export function outdated(yes) {
  by('picture').classList.toggle('outdated', yes);
}

/** What every stage has to say. */
export function notes(list) {
  by('notes-box').hidden = !list.length;
  by('note-count').textContent = list.length;
  by('notes').replaceChildren(...list.map((textContent) => make('li', { textContent })));
}

/** Why a build of what is shown is refused: it stands until something else is shown. */
export function refused(text) {
  by('refused').textContent = text ? `Build refuses this: ${text}` : '';
  by('refused').hidden = !text;
}

/** What was decided for a mesh, each with the key that changes it. */
export function decisions(list) {
  by('decided-box').hidden = !list.length;
  by('decided').replaceChildren(...list.flatMap(({ topic, choice, change }) => [
    make('dt', { textContent: topic }), make('dd', { textContent: choice, title: change ? `change ${change}` : '' }),
  ]));
}

/** Over the picture; nothing takes it away. calm: it is no refusal. */
export function notice(text, calm) {
  by('notice').textContent = text;
  by('notice').hidden = !text;
  by('notice').classList.toggle('calm', calm);
}
