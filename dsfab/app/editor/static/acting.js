/** The form for a load or support at a picked place: its fields, and the entry of the preset that they describe. */

import { make } from './controls.js';
import { told } from './looks.js';

export const TOWARDS = { down: [0, 0, -1], up: [0, 0, 1], '+x': [1, 0, 0], '−x': [-1, 0, 0], '+y': [0, 1, 0], '−y': [0, -1, 0] };
const HOLDS = { 'in all directions': 'xyz', vertically: 'z', 'along x': 'x', 'along y': 'y', sideways: 'xy' };
const ALONG = { 'in all directions': [1, 1, 1], vertically: [0, 0, 1], 'along x': [1, 0, 0], 'along y': [0, 1, 0], sideways: [1, 1, 0] };
const times = (direction, size) => direction.map((x) => x * size);

/** list: list in the preset's surface; size, unit: first values of the form; choices: directions by their words. */
export const KINDS = {
  support: { list: 'support', choices: HOLDS, made: (hold) => ({ hold }) },
  spring: { list: 'support', size: 1e6, unit: 'N/m', choices: ALONG, made: (along, size) => ({ spring: times(along, size) }) },
  force: { list: 'load', size: 1e4, unit: 'N', choices: TOWARDS, made: (along, size) => ({ force: times(along, size) }) },
  line: { list: 'load', size: 1e3, unit: 'N/m', choices: TOWARDS, made: (along, size) => ({ per_metre: times(along, size) }) },
  pressure: { list: 'load', size: 1e3, unit: 'Pa', made: (_, size) => ({ pressure: size }) },
  snow: { list: 'load', size: 1e3, unit: 'Pa', made: (_, size) => ({ pressure: size }) },
  cladding: { list: 'load', size: 250, unit: 'Pa', made: (_, size) => ({ pressure: size }) },
};

const NAMES = { 'N/m': 'newtons per metre', N: 'newtons', Pa: 'pascals' };

/** The fields of a kind, and `read()`: the load or support without its place, or null for an invalid size. */
export function form(kind, cases) {
  const { list, size, unit, choices, made } = KINDS[kind];
  const parts = [];
  const add = (tag, label, properties) => {
    const part = make(tag, properties);
    part.setAttribute('aria-label', label);
    parts.push(part);
    return part;
  };
  const amount = size && add('input', `size in ${NAMES[unit]}`, { type: 'text', id: 'add-size', inputMode: 'decimal', value: String(size) });
  if (size) parts.push(make('span', { textContent: unit }));
  const towards = choices && add('select', 'direction', { id: 'add-way' });
  for (const name of Object.keys(choices ?? {})) towards.append(make('option', { textContent: name }));
  let group = null;
  if (list === 'load') {
    group = add('input', 'load case', { type: 'text', id: 'add-case', value: cases[0] ?? 'load', title: 'Load case: loads of one case act together' });
    group.setAttribute('list', 'cases');
    parts.splice(-1, 0, make('span', { textContent: 'case' }));
    parts.push(make('datalist', { id: 'cases' }));
    parts.at(-1).append(...cases.map((name) => make('option', { value: name })));
  }
  const read = () => {
    const value = size ? Number(amount.value.replace(',', '.')) : 1;
    if (!(value > 0 && Number.isFinite(value))) return null;
    const acts = made(choices?.[towards.value], value);
    return list === 'load' ? { kind, ...acts, case: group.value.trim() || 'load' } : acts;
  };
  return { parts, read };
}

/** [field, size, unit] of a load or a spring that has one size, or null. */
export function magnitude(thing) {
  if (thing.spring && Math.max(...thing.spring) > 0) return ['spring', Math.max(...thing.spring), 'N/m'];
  if (thing.kind === 'force') return ['force', Math.hypot(...thing.force), 'N'];
  if (thing.kind === 'line') return ['per_metre', Math.hypot(...thing.per_metre), 'N/m'];
  if (['pressure', 'snow', 'imposed', 'wind', 'cladding'].includes(thing.kind)) return ['pressure', Math.abs(thing.pressure), 'Pa'];
  return null;
}

/** A picker as text. */
export function where(at) {
  if (!at) return '';
  if (at.pick === 'nearest') return at.points.length === 1 ? 'at a point' : `at ${at.points.length} points`;
  if (at.pick === 'ball') return `within ${at.relative ? `${told(100 * at.radius, '%')} of its size` : told(at.radius, 'm')} of a place`;
  if (at.pick === 'brush') return `painted with ${at.points.length} ${at.points.length === 1 ? 'dot' : 'dots'}`;
  if (at.pick === 'box') return 'in a box';
  if (at.pick === 'side') return `at the ${at.end === 'min' ? 'lowest' : 'highest'} ${at.axis}`;
  if (at.pick === 'boundary' && at.points?.length) return at.points.length > 1 ? 'on a part of an edge' : 'on an edge';
  if (at.pick === 'boundary') return at.loop === 'all' || at.loop === undefined ? 'on all edges' : `on edge ${at.loop + 1}`;
  if (at.pick === 'vertices') return `on ${at.indices.length} vertices`;
  return at.pick === 'all' ? 'everywhere' : `by ${at.pick}`;
}
