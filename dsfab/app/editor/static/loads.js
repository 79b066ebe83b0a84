/** The list of loads and supports: what there is, how much, and adding more by pointing at the surface. */

import { make, short } from './controls.js';
import { told } from './looks.js';

const WAYS = { spot: 'Point', region: 'Region', edge: 'Edge', lasso: 'Lasso' };
const SAY = {
  spot: 'Click on the surface: the nearest vertex is taken.',
  region: 'Press on the surface and pull: a ball around that place.',
  edge: 'Click near a free edge: the whole edge is taken.',
  lasso: 'Draw around vertices; those behind count too.',
};
const TOWARDS = { down: [0, 0, -1], up: [0, 0, 1], '+x': [1, 0, 0], '−x': [-1, 0, 0], '+y': [0, 1, 0], '−y': [0, -1, 0] };

export class Loads {
  /** picked(picker, ...) of Picking is handed to `pick`; place: where the list goes. */
  constructor(place, state, viewer, picking, pending) {
    Object.assign(this, { place, state, viewer, picking, pending, kind: 'force' });
  }

  refresh() {
    const { surface } = this.state.preset;
    const items = [];
    surface.load.forEach((load, i) => items.push(this.item('load', load, i)));
    surface.support.forEach((support, i) => items.push(this.item('support', support, i)));
    this.place.replaceChildren(...items, this.adder());
  }

  item(list, thing, index) {
    const box = make('div', { className: 'acting' });
    const head = make('div', { className: 'head' });
    const name = list === 'load' ? thing.kind.replace('_', ' ') : `support ${thing.hold || 'spring'}`;
    const words = make('span', { title: JSON.stringify(thing.at ?? {}) });
    words.append(make('strong', { textContent: name }), ` ${where(thing.at)}`);
    const remove = make('button', { textContent: '×', title: 'Remove' });
    remove.setAttribute('aria-label', `Remove ${list} ${index + 1}`);
    remove.addEventListener('click', () => {
      const rest = this.state.preset.surface[list].filter((_, i) => i !== index);
      this.state.set({ [`surface.${list}`]: rest });
    });
    head.append(words, remove);
    box.append(head);
    if (list === 'load' && magnitude(thing)) box.append(this.amount(thing, index));
    return box;
  }

  /** How large a load is: a slider from a hundredth to a hundred times of what it was, and a number. */
  amount(load, index) {
    const [field, size, unit] = magnitude(load);
    const id = `load-${index}`;
    const start = Math.log10(size);
    const slider = make('input', { type: 'range', min: Math.floor(start) - 1, max: Math.ceil(start) + 1, step: 0.01, value: start, id: `${id}-slider` });
    slider.setAttribute('aria-label', `size of load ${index + 1}, slider`);
    const number = make('input', { type: 'text', inputMode: 'decimal', id, value: short(size) });
    const send = (value, final) => {
      if (!(value > 0) || !Number.isFinite(value)) return this.refresh();
      const was = load[field];
      const next = Array.isArray(was) ? was.map((x) => (x / size) * value) : Math.sign(was) * value;
      return this.state.set({ [`surface.load.${index}.${field}`]: next }, final);
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
      button.setAttribute('aria-pressed', String(this.picking.kind === way));
      button.addEventListener('click', () => this.begin(this.picking.kind === way ? '' : way));
      box.append(button);
    }
    const say = this.picked ? this.form() : [make('p', { textContent: this.picking.kind ? SAY[this.picking.kind] : 'Add a support or a load: choose how to point at the surface.' })];
    box.prepend(make('p', { textContent: this.picked ? `${this.picked.places.length / 3} vertices picked` : '' }));
    box.append(...say);
    return box;
  }

  begin(way) {
    this.picked = null;
    this.picking.begin(way);
    this.picking.mark([]);
    document.getElementById('picture').classList.toggle('picking', Boolean(way));
    this.refresh();
  }

  /** Something was picked: ask what acts there. */
  pick(picker, places) {
    this.picked = { picker, places };
    this.refresh();
    document.getElementById('add-kind')?.focus();
  }

  form() {
    const kind = make('select', { id: 'add-kind' });
    for (const name of ['support', 'force', 'pressure']) kind.append(make('option', { value: name, textContent: name, selected: name === this.kind }));
    kind.setAttribute('aria-label', 'What acts there');
    kind.addEventListener('change', () => {
      this.kind = kind.value;
      this.refresh();
      document.getElementById('add-kind').focus();
    });
    const parts = [kind];
    const amount = make('input', { type: 'text', id: 'add-size', inputMode: 'decimal', value: this.kind === 'pressure' ? '1000' : '10000' });
    amount.setAttribute('aria-label', `size in ${this.kind === 'pressure' ? 'pascals' : 'newtons'}`);
    const towards = make('select', { id: 'add-way' });
    towards.setAttribute('aria-label', 'direction');
    for (const name of Object.keys(TOWARDS)) towards.append(make('option', { textContent: name }));
    if (this.kind === 'force') parts.push(amount, make('span', { textContent: 'N' }), towards);
    if (this.kind === 'pressure') parts.push(amount, make('span', { textContent: 'Pa' }));
    const add = make('button', { textContent: 'Add', id: 'add' });
    add.addEventListener('click', () => this.add(Number(amount.value.replace(',', '.')), TOWARDS[towards.value]));
    return [...parts, add];
  }

  add(size, direction) {
    const { picker, places } = this.picked;
    const { surface } = this.state.preset;
    const { facts } = this.viewer.data;
    if (this.kind !== 'support' && !(size > 0 && Number.isFinite(size))) return;
    this.picked = null;
    this.begin('');
    if (this.kind === 'support') {
      this.viewer.marks.pendSupports(thin(places), facts.up, facts.size);
      this.state.set({ 'surface.support': [...surface.support, { at: picker, hold: 'xyz' }] });
      return;
    }
    const load = { at: picker, kind: this.kind, case: surface.load[0]?.case ?? 'load' };
    if (this.kind === 'pressure') load.pressure = size;
    else {
      load.force = direction.map((x) => x * size);
      const middle = [0, 1, 2].map((i) => places.filter((_, k) => k % 3 === i).reduce((a, b) => a + b, 0) / (places.length / 3));
      this.viewer.marks.pend([...middle, ...load.force], facts.size);
    }
    this.state.set({ 'surface.load': [...surface.load, load] });
  }
}

/** [field, size, unit] of a load that has one size, or null. */
function magnitude(load) {
  if (load.kind === 'force') return ['force', Math.hypot(...load.force), 'N'];
  if (load.kind === 'pressure') return ['pressure', Math.abs(load.pressure), 'Pa'];
  if (load.kind === 'line') return ['per_metre', Math.hypot(...load.per_metre), 'N/m'];
  return null;
}

/** A picker in words. */
function where(at) {
  if (!at) return '';
  if (at.pick === 'nearest') return at.points.length === 1 ? `at (${at.points[0].map(short).join(', ')})` : `at ${at.points.length} points`;
  if (at.pick === 'ball') return `within ${told(at.radius, 'm')} of (${at.center.map(short).join(', ')})`;
  if (at.pick === 'side') return `at the ${at.end === 'min' ? 'lowest' : 'highest'} ${at.axis}`;
  if (at.pick === 'boundary') return at.loop === 'all' || at.loop === undefined ? 'on all edges' : `on edge ${at.loop + 1}`;
  if (at.pick === 'vertices') return `on ${at.indices.length} vertices`;
  return at.pick === 'all' ? 'everywhere' : `by ${at.pick}`;
}

function thin(places) {
  const step = Math.ceil(places.length / 3 / 40);
  return Float32Array.from(places.filter((_, k) => Math.floor(k / 3) % step === 0));
}
