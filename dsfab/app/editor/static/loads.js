/** The list of loads and supports with their sizes; the user adds more by pointing at the surface. */

import { form, KINDS, magnitude, where } from './acting.js';
import { make, short } from './controls.js';
import { rows } from './regions.js';
import { switched, Weather } from './weather.js';

const WAYS = { spot: 'Point', region: 'Region', edge: 'Edge', lasso: 'Lasso' };
const SAY = {
  spot: 'Click on the surface: the nearest vertex is taken.',
  region: 'Press on the surface and pull: a ball around that place.',
  edge: 'Click near a free edge: the whole edge is taken.',
  lasso: 'Draw around vertices; those behind count too.',
};
export class Loads {
  /** `pick` takes picked(picker, ...) of Picking; place: element for the list. */
  constructor(place, state, viewer, picking) {
    Object.assign(this, { place, state, viewer, picking, kind: 'force', weather: new Weather(state) });
  }

  refresh() {
    const { surface } = this.state.preset;
    const items = [];
    surface.load.forEach((load, i) => switched(load) || items.push(this.item('load', load, i)));
    surface.support.forEach((support, i) => items.push(this.item('support', support, i)));
    const focused = document.activeElement?.id;
    this.place.replaceChildren(...this.weather.rows(), ...items, this.adder());
    if (focused) document.getElementById(focused)?.focus();
  }

  item(list, thing, index) {
    const box = make('div', { className: 'acting' });
    const head = make('div', { className: 'head' });
    const name = list === 'load' ? thing.kind.replace('_', ' ') : thing.hold ? `support ${thing.hold}` : 'spring';
    const words = make('span', { title: JSON.stringify(thing.at ?? {}) });
    const group = this.cases.length > 1 && thing.case ? `case ${thing.case}` : '';
    words.append(make('strong', { textContent: name }), ` ${[where(thing.at), group].filter(Boolean).join(', ')}`);
    const remove = make('button', { textContent: '×', title: 'Remove' });
    remove.setAttribute('aria-label', `Remove ${list} ${index + 1}`);
    remove.addEventListener('click', () => {
      const rest = this.state.preset.surface[list].filter((_, i) => i !== index);
      this.state.set({ [`surface.${list}`]: rest });
    });
    head.append(words, remove);
    box.append(head);
    if (magnitude(thing)) box.append(this.amount(list, thing, index));
    box.append(...rows({ key: `surface.${list}.${index}.at`, name: `${list} ${index + 1}`, at: thing.at }, this.state));
    return box;
  }

  /** Size of a load: a slider from a hundredth to a hundred times its first value, and a number. */
  amount(list, thing, index) {
    const [field, size, unit] = magnitude(thing);
    const id = `${list}-${index}`;
    const start = Math.log10(size);
    const slider = make('input', { type: 'range', min: Math.floor(start) - 1, max: Math.ceil(start) + 1, step: 0.01, value: start, id: `${id}-slider` });
    slider.style.setProperty('--filled', `${(100 * (start - slider.min)) / (slider.max - slider.min)}%`);
    slider.setAttribute('aria-label', `size of ${list} ${index + 1}, slider`);
    const number = make('input', { type: 'text', inputMode: 'decimal', id, value: short(size) });
    const send = (value, final) => {
      if (!(value > 0) || !Number.isFinite(value)) return this.refresh();
      const was = thing[field];
      const next = Array.isArray(was) ? was.map((x) => (x / size) * value) : Math.sign(was) * value;
      return this.state.set({ [`surface.${list}.${index}.${field}`]: next }, final);
    };
    const read = () => Number((10 ** slider.valueAsNumber).toPrecision(3));
    slider.addEventListener('input', () => (number.value = short(read())));
    slider.addEventListener('change', () => send(read(), true));
    number.addEventListener('change', () => send(Number(number.value.replace(',', '.')), true));
    const row = make('div', { className: 'row' });
    row.append(make('label', { htmlFor: id, textContent: 'size' }), slider, number, make('span', { className: 'unit', textContent: unit }));
    return row;
  }

  adder() {
    const box = make('div', { className: 'adding' });
    for (const [way, name] of Object.entries(WAYS)) {
      const button = make('button', { textContent: name, title: SAY[way] });
      button.dataset.way = way;
      button.setAttribute('aria-pressed', String(this.way === way));
      button.addEventListener('click', () => this.begin(this.way === way ? '' : way));
      box.append(button);
    }
    const say = this.picked ? this.form() : [make('p', { textContent: this.way ? SAY[this.way] : 'Add a support or a load: choose how to point at the surface.' })];
    box.prepend(make('p', { textContent: this.picked ? `${this.picked.places.length / 3} vertices picked` : '' }));
    box.append(...say);
    return box;
  }

  begin(way) {
    this.picked = null;
    this.picking.begin(way);
    this.picking.mark([]);
  }

  /** The tool that picks a place for a load or a support, or ''. */
  get way() {
    return this.picking.done === this.picking.usual ? this.picking.kind : '';
  }

  /** Show the form for a picked place. */
  pick(picker, places, list) {
    this.picked = { picker, places, list };
    this.refresh();
    document.getElementById('add-kind')?.focus();
  }

  /** Names of the load cases, in the order of the loads. */
  get cases() {
    return [...new Set(this.state.preset.surface.load.map((load) => load.case))];
  }

  form() {
    const kind = make('select', { id: 'add-kind' });
    for (const name of Object.keys(KINDS)) kind.append(make('option', { value: name, textContent: name, selected: name === this.kind }));
    kind.setAttribute('aria-label', 'What acts there');
    kind.addEventListener('change', () => {
      this.kind = kind.value;
      this.refresh();
      document.getElementById('add-kind').focus();
    });
    const { parts, read } = form(this.kind, this.cases);
    const add = make('button', { textContent: 'Add', id: 'add' });
    add.addEventListener('click', () => {
      const acts = read();
      if (acts) this.add(acts);
    });
    return [kind, ...parts, add];
  }

  add(acts) {
    const { picker, places, list } = this.picked;
    const { kind } = this;
    const name = KINDS[kind].list;
    if (kind === 'line' && !this.free(list)) acts.edges = 'all';
    this.picked = null;
    this.begin('');
    this.pend(kind, acts, places);
    this.state.set({ [`surface.${name}`]: [...this.state.preset.surface[name], { at: picker, ...acts }] });
  }

  /** Whether vertices lie along a free edge: two of them at least. */
  free(list) {
    const edge = new Set(this.viewer.data.arrays.loops);
    return list.filter((i) => edge.has(i)).length > 1;
  }

  /** Marks that stand until the server has solved. */
  pend(kind, acts, places) {
    const { marks, data: { facts } } = this.viewer;
    const few = thin(places);
    if (KINDS[kind].list === 'support') marks.pendSupports(few, facts.up, facts.size);
    else if (kind === 'force') marks.pend([...middle(places), ...acts.force], facts.size);
    else if (kind === 'line') marks.pend(Array.from({ length: few.length / 3 }, (_, i) => [...few.slice(3 * i, 3 * i + 3), ...acts.per_metre]).flat(), facts.size);
  }
}

const middle = (places) => [0, 1, 2].map((i) => places.filter((_, k) => k % 3 === i).reduce((a, b) => a + b, 0) / (places.length / 3));

function thin(places) {
  const step = Math.ceil(places.length / 3 / 40);
  return Float32Array.from(places.filter((_, k) => Math.floor(k / 3) % step === 0));
}
