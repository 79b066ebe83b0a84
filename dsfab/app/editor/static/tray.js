/** The tray: the user keeps, renames, reopens and compares variants. */

import { make, short } from './controls.js';
import { mass, metres } from './figures.js';
import { post } from './transport.js';

const by = (id) => document.getElementById(id);

/** Names of figures, and their formatting. */
const FIGURES = {
  share: ['kept', (x) => `${(100 * x).toFixed(1)} %`],
  area: ['area', (x) => `${short(Number(x.toPrecision(3)))} m²`],
  mass: ['mass', mass],
  pieces: ['pieces', String],
  narrowest: ['narrowest member', metres],
  compliance: ['compliance, uncut', (x) => `${short(Number(x.toPrecision(3)))} J`],
};

export class Tray {
  /** start: facts of the server. shown(): promise of the current { changes, picture, figures }; back(start): show a preset; say(text): show a notice. */
  constructor(start, { shown, back, say }) {
    Object.assign(this, { shown, back, say, chosen: [] });
    by('keep').addEventListener('click', () => this.keep());
    by('compare').addEventListener('click', () => this.compare());
    this.list(start.variants);
  }

  /** Send a request and show the variants of the answer. */
  async change(name, body) {
    try {
      const { variants } = await post(name, body);
      if (variants) this.list(variants);
    } catch (error) {
      this.say(error.message);
    }
  }

  async keep() {
    by('keep').disabled = true;
    const { changes, picture, figures } = await this.shown();
    await this.change('keep', { changes, picture, figures: figures ?? {}, name: '' });
    by('keep').disabled = false;
    by('variants').lastElementChild?.scrollIntoView({ inline: 'end' });
  }

  list(variants) {
    this.variants = variants;
    this.chosen = this.chosen.filter((number) => variants.some((one) => one.number === number));
    by('tray').hidden = !variants.length;
    by('variants').replaceChildren(...variants.map((variant) => this.card(variant)));
    this.choose();
  }

  card({ number, name, picture, figures }) {
    const card = make('li');
    const back = make('button', { className: 'thumb', title: `Go back to ${name}` });
    back.append(picture ? make('img', { src: picture, alt: '' }) : '', make('span', { className: 'hidden', textContent: `Go back to ${name}` }));
    back.addEventListener('click', () => this.open(number));
    const title = make('input', { type: 'text', value: name, title: 'Name of the variant', spellcheck: false });
    title.setAttribute('aria-label', `Name of variant ${number}`);
    title.addEventListener('change', () => this.change('rename', { variant: number, name: title.value }));
    const remove = make('button', { className: 'remove', textContent: '×', title: 'Remove' });
    remove.setAttribute('aria-label', `Remove ${name}`);
    remove.addEventListener('click', () => this.change('drop', { variant: number }));
    const box = make('input', { type: 'checkbox', checked: this.chosen.includes(number), title: 'Compare' });
    box.dataset.variant = number;
    box.setAttribute('aria-label', `Compare ${name}`);
    box.addEventListener('change', () => this.choose(number, box.checked));
    const line = make('div', { className: 'line' });
    line.append(box, title, remove);
    card.append(back, line, make('p', { textContent: brief(figures) }));
    return card;
  }

  /** Select at most two variants: a third replaces the first. */
  choose(number, yes) {
    if (number) this.chosen = [...this.chosen.filter((other) => other !== number), ...(yes ? [number] : [])].slice(-2);
    for (const box of by('variants').querySelectorAll('[data-variant]')) box.checked = this.chosen.includes(Number(box.dataset.variant));
    by('compare').disabled = !this.chosen.length;
    by('compare').textContent = this.chosen.length === 1 ? 'Compare with now' : 'Compare';
  }

  async open(variant) {
    try {
      this.back(await post('open', { variant }));
    } catch (error) {
      this.say(error.message);
    }
  }

  /** Show two pictures with their figures, and the differences of their presets. */
  async compare() {
    const [one, other] = this.chosen.map((number) => this.variants.find((variant) => variant.number === number));
    const now = await this.shown();
    const pair = [one, other ?? { name: 'now', ...now }];
    try {
      const { differences } = await post('compare', { variants: this.chosen, changes: now.changes });
      by('side-by-side').replaceChildren(...pair.map((variant) => picture(variant)), table(pair, differences));
      by('comparing').showModal();
      by('comparing').scrollTop = 0; // the button at the end has the focus
    } catch (error) {
      this.say(error.message);
    }
  }
}

const brief = ({ share, mass: kilograms }) => (share ? `${Math.round(100 * share)} %, ${mass(kilograms)}` : '');

function picture({ name, picture: source }) {
  const figure = make('figure');
  figure.append(make('figcaption', { textContent: name }), make('img', { src: source, alt: `Picture of ${name}` }));
  return figure;
}

function table(pair, differences) {
  const body = make('table');
  const line = (tag, ...texts) => {
    const row = make('tr');
    row.append(...texts.map((text, i) => Object.assign(make(i ? tag : 'th', { textContent: text }), i ? {} : { scope: 'row' })));
    body.append(row);
  };
  line('th', '', ...pair.map(({ name }) => name));
  for (const [key, [name, said]] of Object.entries(FIGURES)) {
    const values = pair.map(({ figures }) => figures?.[key] ?? null);
    if (values.some((value) => value !== null)) line('td', name, ...values.map((value) => (value === null ? '–' : said(value))));
  }
  for (const [key, ...values] of differences) line('td', key, ...values.map(spelled));
  if (!differences.length) line('td', 'presets', 'the same', 'the same');
  return body;
}

function spelled(value) {
  if (value === null || value === undefined) return '–';
  if (Array.isArray(value) && value.some((part) => typeof part === 'object')) return `${value.length} ${value.length === 1 ? 'entry' : 'entries'}`;
  if (Array.isArray(value)) return value.join(', ') || 'none';
  return typeof value === 'number' ? short(value) : String(value);
}
