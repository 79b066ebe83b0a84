/** Switches for self-weight, snow and wind on the whole surface; the list below them has the other loads. */

import { TOWARDS } from './acting.js';
import { make, short } from './controls.js';
import { same } from './state.js';

const SWITCHES = {
  self_weight: { label: 'self-weight', start: {} },
  snow: { label: 'snow', start: { pressure: 800 }, hint: 'Pascals on the ground plan, shape factor and all (EN 1991-1-3).' },
  wind: { label: 'wind', start: { pressure: 500, direction: TOWARDS['+x'] }, hint: 'Velocity pressure in pascals, and where it blows to: a first estimate (EN 1991-1-4).' },
};
const LEVEL = ['+x', '−x', '+y', '−y'];

/** Whether a load is one of the switches: self-weight, or snow or wind without a place. */
export const switched = (load) => load.kind in SWITCHES && (!load.at || load.at.pick === 'all');

export class Weather {
  constructor(state) {
    this.state = state;
  }

  get loads() {
    return this.state.preset.surface.load;
  }

  /** A row for each; if a preset has several of a kind, the row is for the first. */
  rows() {
    return Object.entries(SWITCHES).map(([kind, { label, hint }]) => {
      const index = this.loads.findIndex((load) => load.kind === kind && switched(load));
      const id = `weather-${kind}`;
      const box = make('input', { type: 'checkbox', id, checked: index >= 0 });
      box.addEventListener('change', () => this.turn(kind, index));
      const row = make('div', { className: 'row weather', title: hint ?? '' });
      row.append(make('label', { htmlFor: id, textContent: label }), box);
      if (index >= 0 && kind !== 'self_weight') row.append(...this.size(kind, index));
      if (index >= 0 && kind === 'wind') row.append(this.way(index));
      return row;
    });
  }

  /** Switch a load on or off; a new one joins the case of the first load. */
  turn(kind, index) {
    const rest = this.loads.filter((_, i) => i !== index);
    const added = { kind, ...SWITCHES[kind].start, case: this.loads[0]?.case ?? 'load' };
    this.state.set({ 'surface.load': index >= 0 ? rest : [...this.loads, added] });
  }

  size(kind, index) {
    const { pressure } = this.loads[index];
    const field = make('input', { type: 'text', inputMode: 'decimal', id: `weather-${kind}-size`, value: short(pressure) });
    field.setAttribute('aria-label', `${kind} in pascals`);
    field.addEventListener('change', () => {
      const value = Number(field.value.replace(',', '.'));
      if (value > 0 && Number.isFinite(value)) this.state.set({ [`surface.load.${index}.pressure`]: value });
      else field.value = short(pressure);
    });
    return [field, make('span', { className: 'unit', textContent: 'Pa' })];
  }

  /** The direction of the wind. */
  way(index) {
    const { direction } = this.loads[index];
    const select = make('select', { id: 'weather-wind-way' });
    select.setAttribute('aria-label', 'wind blows to');
    const known = LEVEL.find((name) => same(TOWARDS[name], direction));
    for (const name of known ? LEVEL : [...LEVEL, 'its own']) select.append(make('option', { textContent: name, value: name }));
    select.value = known ?? 'its own';
    select.addEventListener('change', () => this.state.set({ [`surface.load.${index}.direction`]: TOWARDS[select.value] ?? direction }));
    return select;
  }
}
