/** Sliders and numbers: one row for each control of the server's table. */

import { ROWS } from './rows.js';

const OPEN = ['stripes', 'major stripes', 'minor stripes', 'width of members'];
const PLACES = 4;
const LONG = 1e6; // larger numbers have an exponent, because the fields are narrow
const FINEST = 10; // a slider makes stripes at most this many times closer than the default

/** A number as text, in decimal notation if it is short. */
export function short(value) {
  const rounded = Number(Number(value).toPrecision(PLACES));
  return Math.abs(rounded) < LONG ? String(rounded) : rounded.toExponential().replace('e+', 'e');
}

export class Controls {
  /** parent: element for the groups. */
  constructor(parent, state) {
    this.parent = parent;
    this.state = state;
    this.rows = new Map();
  }

  /** Take another table; rows that remain keep their focus. */
  build(table) {
    const signature = JSON.stringify(table);
    if (signature === this.signature) return this.refresh();
    this.signature = signature;
    const shut = [...this.parent.querySelectorAll('details:not([open])')].map((group) => group.dataset.name);
    const first = !this.rows.size;
    const focused = document.activeElement?.id;
    this.rows.clear();
    this.parent.replaceChildren();
    for (const control of table) {
      const name = control.group;
      let group = [...this.parent.children].find((child) => child.dataset.name === name);
      if (!group) {
        group = make('details', { open: first ? OPEN.includes(name) : !shut.includes(name) });
        group.dataset.name = name;
        group.append(make('summary', { textContent: name[0].toUpperCase() + name.slice(1) }));
        this.parent.append(group);
      }
      const row = ROWS[control.kind]?.(control, this.state) ?? (this[control.kind] ?? this.number).call(this, control);
      this.rows.set(control.key, row);
      group.append(row.element);
    }
    this.refresh();
    if (focused) document.getElementById(focused)?.focus();
    return undefined;
  }

  choice(control) {
    const id = control.key.replaceAll('.', '-');
    const select = make('select', { id });
    for (const word of control.choices) select.append(make('option', { value: word, textContent: word }));
    select.addEventListener('change', () => this.state.set({ [control.key]: select.value }));
    const element = make('div', { className: 'row', title: control.hint });
    element.append(make('label', { htmlFor: id, textContent: control.label }), select);
    return { control, element, inputs: [select], refresh: (value) => (select.value = value) };
  }

  switch(control) {
    const id = control.key.replaceAll('.', '-');
    const box = make('input', { type: 'checkbox', id });
    box.addEventListener('change', () => this.state.set({ [control.key]: box.checked }));
    const element = make('div', { className: 'row', title: control.hint });
    element.append(make('label', { htmlFor: id, textContent: control.label }), box);
    const refresh = (value) => {
      box.checked = value;
      box.indeterminate = (value ?? null) === null; // no value: the method's default
    };
    return { control, element, inputs: [box], refresh };
  }

  number(control) {
    const { key, label, log, low, high, word } = control;
    const worth = control.worth ?? word; // the number of the word
    const id = key.replaceAll('.', '-');
    const whole = control.kind === 'whole';
    const place = (value) => (log ? Math.log10(Math.max(value, low)) : value);
    const slider = make('input', {
      type: 'range', id: `${id}-slider`, min: place(low), max: place(high), step: log ? 0.01 : control.step,
    });
    slider.setAttribute('aria-label', `${label}, slider`);
    const number = make('input', { type: 'text', inputMode: 'decimal', id, autocomplete: 'off' });
    const send = (value, final) => this.state.set(this.exclusive(key, value), final);
    const read = () => {
      const value = log ? Number((10 ** slider.valueAsNumber).toPrecision(3)) : slider.valueAsNumber;
      const even = this.state.preset.pattern.method === 'stripes' && control.instead;
      return whole ? Math.round(value) : even ? Math.max(value, even / FINEST) : value;
    };
    slider.addEventListener('input', () => send(read(), false));
    slider.addEventListener('change', () => send(read(), true));
    number.addEventListener('change', () => {
      const text = number.value.trim().replace(',', '.');
      const value = word && text === word ? worth : Number(text);
      if (text !== '' && (value === worth || Number.isFinite(value)) && !(whole && value !== worth && value % 1)) send(value, true);
      else this.refresh();
    });
    const element = make('div', { className: 'row', title: control.hint });
    const unit = make('span', { className: 'unit', textContent: control.unit === 'periods' ? '' : control.unit });
    element.append(make('label', { htmlFor: id, textContent: label }), slider, number, unit);
    const inputs = [slider, number];
    if (word) {
      const toggle = make('button', { type: 'button', className: 'word', textContent: word });
      toggle.setAttribute('aria-label', `${label}: ${word}`);
      toggle.addEventListener('click', () => send(this.state.get(key) === worth ? read() : worth, true));
      unit.replaceWith(toggle);
      inputs.push(toggle);
    }
    const refresh = (value) => {
      if (word && value === worth) toggleWord(element, number, word, true);
      else {
        toggleWord(element, number, word, false);
        slider.value = place(value);
        if (document.activeElement !== number || number.value === '') number.value = short(value);
        slider.setAttribute('aria-valuetext', `${short(value)} ${control.unit}`);
        const share = (100 * (place(value) - place(low))) / (place(high) - place(low));
        slider.style.setProperty('--filled', `${Math.min(Math.max(share, 0), 100)}%`);
      }
    };
    return { control, element, inputs, refresh };
  }

  /** A family has a frequency or a spacing: setting one resets the other. */
  exclusive(key, value) {
    const values = { [key]: value };
    if (key.endsWith('.spacing')) values[key.replace('spacing', 'frequency')] = value > 0 ? 0 : 8;
    if (key.endsWith('.frequency') && value > 0) values[key.replace('frequency', 'spacing')] = 0;
    if (key.endsWith('.frequency') && !(value > 0)) return {};
    if (key === 'pattern.width.rule' && value === 'constant') return values;
    return values;
  }

  /** Show the state's values, and grey out controls without an effect. */
  refresh() {
    const { pattern } = this.state.preset;
    for (const [key, row] of this.rows) {
      const { method, instead } = row.control;
      row.element.hidden = ![method || pattern.method, 'auto'].includes(pattern.method);
      const value = this.state.get(key) || (pattern.method === 'stripes' && instead) || this.state.get(key);
      if (value !== undefined) row.refresh(value);
      const idle = why(key, pattern);
      row.element.classList.toggle('idle', Boolean(idle));
      row.element.title = idle || row.control.hint;
      row.element.classList.toggle('changed', key in this.state.changes);
    }
  }
}

/** The reason why a control has no effect now, or ''. */
function why(key, pattern) {
  const { rule, solid_fraction: fraction } = pattern.width;
  const parts = key.split('.');
  const [family, name] = [parts[1], parts.at(-1)];
  if (['major', 'minor'].includes(family) && !['both', family].includes(pattern.families)) return `Only the ${pattern.families} family is drawn.`;
  if (key === 'pattern.halve' && pattern.families !== 'both') return 'One family alone has no members to end on.';
  if (name === 'threshold' && rule === 'constant') return 'The rule constant takes its width in metres instead.';
  if (name === 'threshold' && fraction > 0 && rule === 'plain') return 'Scaled until the solid fraction is met.';
  if (name === 'member' && rule !== 'constant') return 'Only with the rule constant.';
  if (name === 'member' && fraction > 0) return 'Solved for: the solid fraction decides.';
  if (name === 'q' && !['graded', 'stressed'].includes(rule)) return 'Only with the rules graded and stressed.';
  if (name === 'steps' && rule !== 'stressed') return 'Only with the rule stressed.';
  if (name === 'frequency' && !pattern[key.split('.')[1]].frequency) return 'The spacing decides; move it to take it back.';
  return '';
}

function toggleWord(element, number, word, on) {
  element.classList.toggle('auto', on);
  element.querySelector('.word')?.setAttribute('aria-pressed', String(on));
  if (on) number.value = word;
}

export function make(tag, properties = {}) {
  return Object.assign(document.createElement(tag), properties);
}
