/** Regions of the pattern drawn by hand: brush strokes and balls that are solid, void, or have a solid band. */

import { make, short } from './controls.js';

const DOES = { keep: 'solid', void: 'opening', rim: 'band along its edge' };
const WAYS = { brush: 'Paint', region: 'Ball' };
const SAY = {
  brush: 'Paint on the surface; the next stroke belongs to the same region. Press Paint again to end it.',
  region: 'Press on the surface and pull: a ball around that place.',
};

export class Painting {
  /** viewer and picking may be missing; then painting is disabled. */
  constructor(state, viewer, picking) {
    Object.assign(this, { state, viewer, picking, do: 'keep', radius: 0, own: -1, done: (picker) => this.add(picker) });
  }

  /** The tool that picks regions, or ''. */
  get way() {
    return this.picking?.done === this.done ? this.picking.kind : '';
  }

  get regions() {
    return this.state.preset.pattern.region ?? [];
  }

  /** Rows for the tool, the effect of the region, and the width of the brush. */
  form() {
    if (!this.picking || !this.viewer.data) return [];
    this.radius ||= Number((this.viewer.data.facts.size / 40).toPrecision(1));
    const box = make('div', { className: 'adding' });
    for (const [way, name] of Object.entries(WAYS)) {
      const button = make('button', { textContent: name, title: SAY[way], id: `paint-${way}` });
      button.setAttribute('aria-pressed', String(this.way === way));
      button.addEventListener('click', () => this.begin(this.way === way ? '' : way));
      box.append(button);
    }
    const does = make('select', { id: 'paint-do' });
    does.setAttribute('aria-label', 'What the region is');
    for (const [value, textContent] of Object.entries(DOES)) does.append(make('option', { value, textContent }));
    does.value = this.do;
    does.addEventListener('change', () => {
      [this.do, this.own] = [does.value, -1];
    });
    const radius = make('input', { type: 'text', inputMode: 'decimal', id: 'paint-radius', value: short(this.radius) });
    radius.setAttribute('aria-label', 'Radius of the brush, metres');
    radius.addEventListener('change', () => {
      const value = Number(radius.value.replace(',', '.'));
      if (value > 0 && Number.isFinite(value)) [this.radius, this.own] = [value, -1];
      if (this.way) this.picking.radius = this.radius;
      radius.value = short(this.radius);
    });
    box.append(does, radius, make('span', { className: 'unit', textContent: 'm' }), make('p', { textContent: SAY[this.way] ?? 'Paint what is to be solid, an opening, or to have a band along its edge.' }));
    return [box];
  }

  begin(way) {
    this.own = -1;
    this.picking.begin(way, this.radius, this.done);
    this.picking.mark([]);
  }

  /** Add a region, or extend the one in the current stroke. */
  add(at) {
    const list = [...this.regions];
    const before = list[this.own];
    if (at.pick === 'brush' && before?.at.pick === 'brush') {
      list[this.own] = { ...before, at: { ...before.at, points: [...before.at.points, ...at.points] } };
    } else {
      this.own = list.length;
      list.push({ at, do: this.do });
    }
    this.state.set({ 'pattern.region': list });
    if (at.pick !== 'brush') this.begin('');
  }
}

/** The effect of a region in a word. */
export const doing = (word) => DOES[word] ?? word;
