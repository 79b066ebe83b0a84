/** Settings of the view: sides, colours, layers, section, theme. They do not change the preset. */

import { histogram } from './figures.js';
import { colouring, look, onTheme, turn } from './looks.js';
import { isMeasure } from './members.js';

const by = (id) => document.getElementById(id);
const MODES = ['major', 'minor'];
const LAYERS = ['loads', 'supports', 'reactions'];

export class Views {
  /** editor: has the state and the viewer. */
  constructor(editor) {
    this.editor = editor;
  }

  wire() {
    by('theme').addEventListener('click', () => {
      turn();
      this.paint();
    });
    onTheme(() => this.paint());
    by('colour').value = this.editor.state.view.colour;
    by('colour').addEventListener('change', () => this.view({ colour: by('colour').value }));
    by('layers').addEventListener('click', ({ target }) => target.dataset.layer && this.layer(target.dataset.layer));
    by('views').addEventListener('click', ({ target }) => target.dataset.view && this.look(target.dataset.view));
    by('fit').addEventListener('click', () => this.editor.viewer?.eye.fit());
    by('parallel').addEventListener('click', () => this.parallel());
    for (const id of ['section-axis', 'section-at']) by(id).addEventListener('input', () => this.view({ section: [by('section-axis').value, by('section-at').valueAsNumber] }));
    const [axis, at] = this.editor.state.view.section ?? ['', 0];
    [by('section-axis').value, by('section-at').value] = [axis, at];
    if (axis) by('section').open = true;
  }

  view(changes) {
    Object.assign(this.editor.state.view, changes);
    this.colours();
    this.editor.remember();
  }

  layer(name) {
    const on = new Set(this.editor.state.view.layers);
    on.delete(name) || on.add(name);
    this.view({ layers: [...on] });
  }

  look(name, fresh = true) {
    this.editor.viewer?.eye.view(name);
    this.editor.pictures?.look(name, this.editor.state.changes);
    if (fresh) this.editor.remember();
  }

  parallel() {
    const { eye } = this.editor.viewer ?? {};
    if (!eye) return;
    eye.project(eye.camera !== eye.parallel);
    by('parallel').setAttribute('aria-pressed', String(eye.camera === eye.parallel));
    this.editor.remember();
  }

  /** Apply colours, layers and section. */
  paint() {
    this.editor.viewer?.page(look());
    histogram();
    this.colours();
  }

  colours() {
    const { layers, section } = this.editor.state.view;
    const modes = this.editor.model?.facts.method !== 'stripes'; // evenly spaced stripes have no modes
    for (const name of MODES) by('colour').querySelector(`[value=${name}]`).hidden = !modes;
    const colour = modes || !MODES.includes(this.editor.state.view.colour) ? this.editor.state.view.colour : 'plain';
    by('colour').value = colour;
    for (const button of by('layers').children) button.setAttribute('aria-pressed', String(layers.includes(button.dataset.layer)));
    if (!this.editor.model || !this.editor.viewer) return;
    const { model, start, mode } = this.editor;
    const measured = isMeasure(colour) ? this.editor.members.colouring(colour, look().families, start.colours.rising) : null;
    const [how, legend] = measured ?? colouring(colour, model, start.colours, mode);
    this.editor.viewer.colours(how);
    this.editor.viewer.whole(layers.includes('sheet'));
    this.editor.viewer.section(...(section ?? ['', 0]));
    for (const name of LAYERS) this.editor.viewer.marks.show(name, layers.includes(name));
    by('legend').hidden = !legend;
    if (!legend) return;
    for (const part of ['title', 'low', 'high']) by(`legend-${part}`).textContent = legend[part];
    const pen = by('ramp').getContext('2d');
    legend.ramp.forEach((rgb, i) => {
      pen.fillStyle = `rgb(${rgb})`;
      pen.fillRect((128 * i) / legend.ramp.length, 0, 3, 1);
    });
  }
}
