/** Builds and exports: name, formats, results, and the command line that does the same. */

import { make } from './controls.js';
import { mass } from './figures.js';
import { lead, post } from './transport.js';

const by = (id) => document.getElementById(id);
const USUAL = ['stl', '3mf', 'step'];
const NAME = /^[A-Za-z0-9][A-Za-z0-9_.-]*$/;

export class Making {
  /** start: facts of the server; state: has name and formats; ask(kind, body): start a job; say(text, calm): show a notice; save(): download the preset. */
  constructor(start, { state, ask, say, save }) {
    Object.assign(this, { start, state, ask, say, save });
    by('place').textContent = start.outputs ? `${start.outputs}/` : '';
    by('name').addEventListener('change', () => this.rename(by('name').value.trim()));
    by('formats').addEventListener('change', () => this.state.set({ 'export.formats': this.wanted() }));
    by('build').addEventListener('click', () => this.build());
    by('export').addEventListener('click', () => this.offer());
    by('copy').addEventListener('click', () => this.copy());
  }

  /** Show the state's name and formats. */
  refresh() {
    const { name, export: { formats } } = this.state.preset;
    if (name !== this.name) by('name').value = this.name = name;
    const listed = [...new Set([...USUAL, ...formats])];
    if (String(listed) !== this.listed) {
      this.listed = String(listed);
      by('formats').replaceChildren(...listed.map((format) => {
        const label = make('label');
        label.append(make('input', { type: 'checkbox', value: format }), format.toUpperCase());
        return label;
      }));
    }
    for (const box of by('formats').querySelectorAll('input')) box.checked = formats.includes(box.value);
  }

  rename(name) {
    if (NAME.test(name)) return this.state.set({ name });
    this.say(`“${name}” is no name for files: use letters, digits, dots and dashes.`, true);
    by('name').value = this.state.preset.name;
    return undefined;
  }

  wanted() {
    return [...by('formats').querySelectorAll('input:checked')].map((input) => input.value);
  }

  /** Request a build; if its folder has other files, the user decides first. */
  async build(replace = false) {
    if (!this.wanted().length) return this.say('Choose at least one kind of file.', true);
    return this.begin('build', {}, replace);
  }

  /** Start a job that writes files: a build, or an export of one format. */
  async begin(kind, body, replace = false) {
    this.busy(true, kind === 'build' ? 'Building …' : `Writing ${body.format} …`);
    const { taken, free } = await this.ask(kind, { ...body, changes: this.state.changes, replace });
    if (!taken) return undefined;
    this.busy(false, '');
    const choice = await this.question(taken, free);
    if (choice === 'other') this.state.set({ name: free });
    return choice === 'no' ? undefined : this.begin(kind, body, true);
  }

  busy(yes, text) {
    for (const id of ['build', 'export']) by(id).disabled = yes;
    by('built').replaceChildren(...(text ? [make('p', { textContent: text })] : []));
  }

  /** List all formats by purpose; a format with a missing library says how to install it. */
  async offer() {
    try {
      const { formats } = await post('formats', {});
      const groups = [...new Set(formats.map(({ group }) => group))];
      by('format-list').replaceChildren(...groups.map((group) => this.offered(group, formats.filter((one) => one.group === group))));
      by('exporting').showModal();
    } catch (error) {
      this.say(error.message);
    }
  }

  offered(group, formats) {
    const box = make('section');
    box.append(make('h2', { textContent: group }));
    for (const { format, missing } of formats) {
      const button = make('button', { type: 'button', textContent: format, disabled: Boolean(missing), title: missing });
      button.addEventListener('click', () => {
        by('exporting').close();
        this.begin('export', { format });
      });
      box.append(button);
    }
    box.append(...formats.filter(({ missing }) => missing).map(({ missing }) => make('p', { textContent: missing })));
    return box;
  }

  /** The user's answer: no, other or yes. */
  question(text, free) {
    by('replace-text').textContent = text;
    by('replace-other').textContent = `Build into ${free}`;
    by('replace').returnValue = 'no';
    by('replace').showModal();
    return new Promise((done) => by('replace').addEventListener('close', () => done(by('replace').returnValue || 'no'), { once: true }));
  }

  /** Copy the command; save its preset first, as a download if the server has no folder for it. */
  async copy() {
    try {
      const { command, save, saved } = await post('command', { changes: this.state.changes });
      if (save) await this.save();
      const where = saved ? `${saved} is saved; type this where dsfab edit was started.` : save ? 'Its preset is saved with your downloads.' : '';
      by('command').replaceChildren(make('code', { textContent: command }), where);
      by('command').hidden = false;
      await navigator.clipboard?.writeText(command).catch(() => {}); // the user can copy the shown text
    } catch (error) {
      this.say(error.message);
    }
  }

  /** Show the result of a build or an export. */
  built({ state, text, result }) {
    this.busy(false, state === 'cancelled' ? 'Cancelled; nothing was kept.' : state === 'failed' ? text : '');
    if (state !== 'done') return;
    const links = result.files.map(({ name, bytes }, index) => {
      const link = make('a', { download: name, textContent: name });
      lead(link, result.build, index);
      const line = make('span');
      line.append(link, ` ${size(bytes)}`);
      return line;
    });
    const files = make('div', { className: 'files' });
    files.append(...links);
    const place = result.folder ? [`${links.length === 1 ? 'It is' : 'All files are'} in ${result.folder}:`] : [];
    const told = result.told ?? [solid(result), ...(result.refused ? [result.refused] : [])];
    by('built').replaceChildren(...[...told, ...place].map((textContent) => make('p', { textContent })), files);
  }
}

function solid({ pieces, triangles, mass: kilograms }) {
  return `Solid: ${triangles.toLocaleString('en')} triangles, ${mass(kilograms)}, ${pieces} ${pieces === 1 ? 'piece' : 'pieces'}, closed.`;
}

function size(bytes) {
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} KB` : `${(bytes / 1e6).toFixed(1)} MB`;
}
