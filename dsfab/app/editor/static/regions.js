/** Places in a preset as number fields and handles: balls, boxes, points, and curves of guides. */

import { make, short } from './controls.js';

const MOST = 8; // points of a place with fields of their own, at most

/** Entries of a preset with a place: { key, name, at } of supports, loads, guides and regions, in the order of the lists. */
export function regions({ surface, pattern }) {
  const lists = { 'surface.load': surface.load, 'surface.support': surface.support, 'pattern.guide': pattern.guide, 'pattern.region': pattern.region };
  return Object.entries(lists).flatMap(([list, things]) => (things ?? []).map((thing, i) => {
    const name = `${list.split('.')[1]} ${i + 1}`;
    return thing.curve ? { key: `${list}.${i}`, name, at: { curve: thing.curve } } : { key: `${list}.${i}.at`, name, at: thing.at };
  }));
}

/** The numbers of a place: [key below it, its name, value], three coordinates or a length in metres. */
export function numbers(at) {
  const list = (points, key, name) => (points.length > MOST ? [] : points.map((point, i) => [`${key}.${i}`, points.length > 1 ? `${name} ${i + 1}` : name, point]));
  if (at?.curve) return list(at.curve, 'curve', 'point');
  if (at?.pick === 'ball') return [['center', 'centre', at.center], ['radius', 'radius', at.radius]];
  if (at?.pick === 'box') return [['min', 'from', at.min], ['max', 'to', at.max]];
  if (at?.pick === 'nearest') return list(at.points, 'points', 'point');
  if (at?.pick === 'brush') return [['radius', 'radius', at.radius]];
  return [];
}

/** Rows of fields for a region; they set `state`. */
export function rows({ key, name, at }, state) {
  return numbers(at).map(([part, word, value]) => {
    const row = make('div', { className: 'row place' });
    const list = [value].flat();
    const fields = list.map((x, i) => {
      const id = `${key}.${part}${list.length > 1 ? `.${'xyz'[i]}` : ''}`.replaceAll('.', '-');
      const field = make('input', { type: 'text', inputMode: 'decimal', id, value: short(x) });
      field.setAttribute('aria-label', `${name}: ${word}${list.length > 1 ? ` ${'xyz'[i]}` : ''}`);
      field.addEventListener('change', () => {
        const next = Number(field.value.trim().replace(',', '.'));
        if (!Number.isFinite(next) || field.value.trim() === '' || (list.length === 1 && next <= 0)) field.value = short(x);
        else state.set({ [`${key}.${part}`]: list.length > 1 ? list.with(i, next) : next });
      });
      return field;
    });
    row.append(make('span', { textContent: word }), ...fields, make('span', { className: 'unit', textContent: at.relative ? '' : 'm', title: at.relative ? 'shares of the box of the surface' : '' }));
    return row;
  });
}

/** Handles of a region: { id, name, place [x, y, z], moved(place): values to set after a drag there }. */
export function handles({ key, name, at }) {
  if (at?.relative) return []; // shares of the surface's box: numbers only
  const one = (part, word, place, moved) => ({ id: `${key}.${part}`, name: `${name}: ${word}`, place, moved });
  if (at?.pick === 'box') {
    const middle = at.min.map((x, i) => (x + at.max[i]) / 2);
    const by = (corner, to) => corner.map((x, i) => rounded(x + to[i] - middle[i]));
    return [one('middle', 'middle', middle, (to) => ({ [key]: { ...at, min: by(at.min, to), max: by(at.max, to) } }))];
  }
  const points = numbers(at).filter(([, , value]) => Array.isArray(value));
  const centres = points.map(([part, word, place]) => one(part, word, place, (to) => ({ [`${key}.${part}`]: to })));
  if (at?.pick !== 'ball') return centres;
  const radius = { ...one('radius', 'radius', at.center, (to) => ({ [`${key}.radius`]: reach(at.center, to) })), radius: at.radius };
  return [...centres, radius];
}

const rounded = (x) => Number(x.toFixed(5));
const reach = (a, b) => Math.max(Number(Math.hypot(...a.map((x, i) => x - b[i])).toPrecision(3)), 1e-6);
