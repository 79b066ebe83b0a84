/** The figures of the panel: estimates by the browser, then measures of the cut sheet by the server. */

import { short } from './controls.js';

const by = (id) => document.getElementById(id);

/** Show an estimate from points on the surface, marked as approximate. */
export function estimated(share, facts) {
  by('f-share').textContent = `≈ ${Math.round(100 * share)} %`;
  by('f-area').textContent = `≈ ${metres2(share * facts.area)}`;
  for (const id of ['f-mass', 'f-pieces']) by(id).classList.add('old');
}

/** Show measures: { area, share, mass, pieces, loose, narrowest, under, limits, widths, bars_under, min_member, pattern }. */
export function measured(told) {
  by('f-share').textContent = `${(100 * told.share).toFixed(1)} %`;
  by('f-area').textContent = metres2(told.area);
  by('f-mass').textContent = mass(told.mass);
  by('f-pieces').textContent = told.loose ? `${told.pieces} (${told.loose} loose)` : String(told.pieces);
  for (const id of ['f-mass', 'f-pieces']) by(id).classList.remove('old');
  const narrow = told.narrowest === null ? '' : `, narrowest ${metres(told.narrowest)}${told.under ? `: under ${metres(told.min_member)}` : ''}`;
  by('f-widths').classList.toggle('bad', told.under);
  by('f-widths').textContent = `widths of members${narrow}; ${ends(told.pattern)}`;
  last = told;
  histogram();
}

/** Dead ends, slits and openings in words. */
function ends({ dead_ends, slits, openings }) {
  const count = (number, what) => `${number || 'no'} ${what}${number === 1 ? '' : 's'}`;
  const open = openings ? `, openings ${metres(openings[0])} to ${metres(openings[1])}` : '';
  return `${count(dead_ends, 'dead end')}, ${count(slits, 'slit')}${open}`;
}

let last = null;

/** Show no figures, with the reason. */
export function unknown() {
  for (const id of ['f-share', 'f-area', 'f-mass', 'f-pieces']) by(id).textContent = '–';
  last = null;
  histogram();
}

/** Histogram: metres of wall by width of their member; bars under the least width are red. */
export function histogram() {
  const canvas = by('histogram');
  const ratio = window.devicePixelRatio || 1;
  const wide = canvas.clientWidth || 280;
  Object.assign(canvas, { width: wide * ratio, height: 44 * ratio });
  const pen = canvas.getContext('2d');
  pen.scale(ratio, ratio);
  const style = getComputedStyle(document.documentElement);
  if (!last || !last.widths.length) return;
  const most = Math.max(...last.widths);
  const step = wide / last.widths.length;
  last.widths.forEach((share, i) => {
    pen.fillStyle = style.getPropertyValue(last.bars_under[i] ? '--bad' : '--bar');
    const high = (30 * share) / most;
    pen.fillRect(i * step + 0.5, 31 - high, Math.max(step - 1, 1), high);
  });
  pen.fillStyle = style.getPropertyValue('--line');
  pen.fillRect(0, 31, wide, 1);
  pen.fillStyle = style.getPropertyValue('--quiet');
  pen.font = '10px system-ui, sans-serif';
  pen.fillText('0', 0, 42);
  pen.textAlign = 'right';
  const end = `${metres(last.limits.at(-1))} and more`; // the last bar includes wider members
  pen.fillText(end, wide, 42);
  canvas.setAttribute('aria-label', `Widths of members from 0 to ${end}`);
}

export const metres = (value) => (value < 1 ? `${short3(1000 * value)} mm` : `${short3(value)} m`);
export const mass = (value) => (value < 1 ? `${short3(1000 * value)} g` : value < 1000 ? `${short3(value)} kg` : `${short3(value / 1000)} t`);
const metres2 = (value) => (value < 0.1 ? `${short3(1e4 * value)} cm²` : `${short3(value)} m²`);
const short3 = (value) => short(Number(value).toPrecision(3));
