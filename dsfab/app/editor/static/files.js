/** Files: presets and meshes in, presets out. */

import { base64, download } from './bytes.js';
import { make } from './controls.js';
import { post } from './transport.js';

const by = (id) => document.getElementById(id);
const MOST = 64 * 2 ** 20; // bytes of a mesh; base64 takes a third more

export class Files {
  /** start: facts of the server; changes(): current changes; opened(start): called after opening; ask(kind, body): start a job; say(text): show a notice. */
  constructor(start, { changes, opened, ask, say }) {
    Object.assign(this, { changes, opened, ask, say });
    by('ask-unit').append(make('option', { value: '', textContent: 'as its size says' }), ...start.units.map((unit) => make('option', { textContent: unit })));
    by('save').addEventListener('click', () => this.save());
    by('open').addEventListener('click', () => by('file').click());
    by('file').addEventListener('change', () => by('file').files[0] && this.take(by('file').files[0]));
    by('preset').addEventListener('change', () => this.open({ preset: by('preset').value }));
    this.drop(by('picture'));
    this.list(start);
  }

  /** List the shipped presets; another open preset comes first. */
  list(start) {
    const names = start.presets.includes(start.title) ? start.presets : [start.title, ...start.presets];
    by('preset').replaceChildren(...names.map((name) => make('option', { value: name, textContent: name })));
    by('preset').value = start.title;
    document.title = `${start.title} · dsfab`;
  }

  async open(what) {
    try {
      this.opened(await post('open', what));
    } catch (error) {
      this.say(error.message);
    }
  }

  /** Handle the end of the job that reads a mesh. */
  read({ state, text, result }) {
    if (state === 'done') this.opened(result);
    else if (state === 'failed') this.say(text);
  }

  drop(place) {
    place.addEventListener('dragover', (event) => {
      event.preventDefault();
      place.classList.add('drop');
    });
    place.addEventListener('dragleave', () => place.classList.remove('drop'));
    place.addEventListener('drop', (event) => {
      event.preventDefault();
      place.classList.remove('drop');
      if (event.dataTransfer.files[0]) this.take(event.dataTransfer.files[0]);
    });
  }

  /** Open the user's file: a preset, or a mesh, after asking for its unit. */
  async take(file) {
    by('file').value = '';
    if (file.size > MOST) return this.say(`${file.name} has more than ${MOST >> 20} MB; make the mesh coarser.`);
    if (file.name.toLowerCase().endsWith('.toml')) return this.open({ toml: await file.text() });
    const knows = /\.(glb|gltf|3mf)$/i.test(file.name);
    const unit = knows ? null : await this.unit(file.name);
    if (unit === undefined) return undefined;
    return this.ask('open', { name: file.name, unit: unit || null, data: await base64(file) });
  }

  unit(name) {
    by('ask-text').textContent = `In which unit are the numbers in ${name}?`;
    by('ask').showModal();
    return new Promise((done) => {
      by('ask').addEventListener('close', () => done(by('ask').returnValue === 'yes' ? by('ask-unit').value : undefined), { once: true });
    });
  }

  async save() {
    try {
      const { name, toml } = await post('preset', { changes: this.changes() });
      download(name, toml, 'application/toml');
    } catch (error) {
      this.say(error.message);
    }
  }
}
