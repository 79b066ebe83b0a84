/** Colours of the page in light and dark, and colour scales of the structure. */

const byte = (...rgb) => rgb.map((value) => value / 255);

const LIGHT = {
  paper: byte(250, 249, 246), shadow: byte(84, 80, 78), dark: 0.36,
  families: [byte(226, 160, 124), byte(240, 203, 148), byte(176, 112, 94)],
  marks: { loads: byte(32, 84, 168), supports: byte(58, 74, 70), reactions: byte(140, 52, 120), picked: byte(0, 130, 110) },
};
const DARK = {
  paper: byte(27, 28, 30), shadow: byte(0, 0, 0), dark: 0.6,
  families: [byte(222, 160, 126), byte(238, 204, 152), byte(178, 116, 98)],
  marks: { loads: byte(116, 164, 240), supports: byte(160, 178, 172), reactions: byte(214, 130, 200), picked: byte(70, 210, 180) },
};

const dark = window.matchMedia('(prefers-color-scheme: dark)');

export const isDark = () => (document.documentElement.dataset.theme || (dark.matches ? 'dark' : 'light')) === 'dark';

export const look = () => (isDark() ? DARK : LIGHT);

/** Call `hear` when the system's own theme changes. */
export const onTheme = (hear) => dark.addEventListener('change', hear);

/** Switch to the other theme, and store it in the browser if it allows that. */
export function turn() {
  document.documentElement.dataset.theme = isDark() ? 'light' : 'dark';
  remember(document.documentElement.dataset.theme);
}

function remember(theme) {
  try {
    localStorage.setItem('dsfab-theme', theme);
  } catch {
    // private windows may refuse, then the theme ends with the page
  }
}

export function recall() {
  try {
    document.documentElement.dataset.theme = localStorage.getItem('dsfab-theme') ?? '';
  } catch {
    document.documentElement.dataset.theme = '';
  }
}

/** '12.3 MPa', '4.5 mm': a value with a prefix that keeps it readable. */
export function told(value, unit) {
  const size = Math.abs(value);
  const [factor, prefix] = [[1e9, 'G'], [1e6, 'M'], [1e3, 'k'], [1, ''], [1e-3, 'm'], [1e-6, 'µ']].find(([f]) => size >= f) ?? [1, ''];
  return `${Number((value / factor).toPrecision(3))} ${prefix}${unit}`;
}

/** Arguments of Viewer.colours for an entry of the list, and its legend { title, low, high, ramp } or null. */
export function colouring(choice, model, scales, mode) {
  const { families } = look();
  const { facts, arrays } = model;
  const n = arrays.V.length / 3;
  if (choice === 'stress') {
    const limit = facts.limits.stress;
    const legend = { title: 'principal stress', low: told(-limit, 'Pa'), high: told(limit, 'Pa'), ramp: scales.diverging };
    return [{ families, values: arrays.stress, limit, low: -1, ramp: scales.diverging }, legend];
  }
  if (choice === 'major' || choice === 'minor') {
    const k = choice === 'major' ? 0 : 1;
    const values = arrays[choice].subarray((mode[k] - 1) * n, mode[k] * n);
    const limit = values.reduce((most, value) => Math.max(most, Math.abs(value)), 1e-9);
    const high = Number(limit.toPrecision(2));
    const legend = { title: `${choice} mode ${mode[k]}`, low: String(-high), high: String(high), ramp: scales.signed };
    return [{ families, values, limit, low: -1, ramp: scales.signed }, legend];
  }
  if (choice === 'displacement') {
    const limit = facts.limits.displacement || 1;
    const values = Float32Array.from({ length: n }, (_, i) => Math.hypot(arrays.u[3 * i], arrays.u[3 * i + 1], arrays.u[3 * i + 2]));
    const move = (0.025 * facts.size) / limit;
    const legend = { title: `displacement, drawn ${Math.round(move)} ×`, low: '0', high: told(limit, 'm'), ramp: scales.rising };
    return [{ families, values, limit, low: 0, ramp: scales.rising, move }, legend];
  }
  return [{ families, byFamily: choice === 'family' }, null];
}
