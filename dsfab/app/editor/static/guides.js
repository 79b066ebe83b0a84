/** The list of guides and regions of the pattern, with effect and place. */

import { where } from './acting.js';
import { make } from './controls.js';
import { doing, Painting } from './painting.js';
import { regions, rows } from './regions.js';

export class Guides {
  /** place: element for the list; painting: tool that adds regions. */
  constructor(place, state, viewer, picking) {
    Object.assign(this, { place, state, painting: new Painting(state, viewer, picking) });
  }

  refresh() {
    const { pattern } = this.state.preset;
    const lists = { guide: pattern.guide ?? [], region: pattern.region ?? [] };
    const items = Object.entries(lists).flatMap(([list, things]) => things.map((thing, index) => this.item(list, thing, index)));
    const focused = document.activeElement?.id;
    const form = this.painting.form();
    this.place.replaceChildren(...items, ...form);
    this.place.parentElement.hidden = !(items.length || form.length);
    if (focused) document.getElementById(focused)?.focus();
  }

  item(list, thing, index) {
    const box = make('div', { className: 'acting' });
    const head = make('div', { className: 'head' });
    const words = make('span');
    const does = list === 'guide' ? `guides ${thing.family} stripes` : doing(thing.do);
    words.append(make('strong', { textContent: does }), ` ${thing.curve ? `along ${thing.curve.length} points` : where(thing.at)}`);
    const remove = make('button', { textContent: '×', title: 'Remove' });
    remove.setAttribute('aria-label', `Remove ${list} ${index + 1}`);
    remove.addEventListener('click', () => this.state.set({ [`pattern.${list}`]: this.state.preset.pattern[list].filter((_, i) => i !== index) }));
    head.append(words, remove);
    const region = regions(this.state.preset).find(({ key }) => key.startsWith(`pattern.${list}.${index}`));
    box.append(head, ...rows(region, this.state));
    return box;
  }
}
