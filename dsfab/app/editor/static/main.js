/** The editor: connects one state with the parts that change it and the parts that show it. */

import { Controls } from './controls.js';
import { estimated, histogram, measured, unknown } from './figures.js';
import { Files } from './files.js';
import { Guides } from './guides.js';
import { Handles } from './handles.js';
import { keyed } from './keys.js';
import { Loads } from './loads.js';
import { recall } from './looks.js';
import { Making } from './making.js';
import { Materials } from './materials.js';
import { drawn, Sampler } from './pattern.js';
import { isMeasure, Members } from './members.js';
import { decisions, notes, notice, outdated, refused } from './notices.js';
import { Picking } from './picking.js';
import { Pictures } from './pictures.js';
import { State } from './state.js';
import { begun, cut, early, follow, keep, kept, model as fetched } from './transport.js';
import { Tray } from './tray.js';
import { Viewer } from './viewer.js';
import { Views } from './views.js';
import { Work } from './work.js';

const by = (id) => document.getElementById(id);
const WAIT = 120; // milliseconds from the last change to a request
const REST = 700; // the same during a drag that the browser draws, because solving would slow down the drawing
const UNSEEN = /^(name|description|export\..*)$/; // keys that change files alone

recall();

class Editor {
  constructor(start) {
    this.start = start;
    this.asking = []; // resolvers that wait for the measures of the current picture
    const { changes, view } = kept(start);
    this.state = new State(start.preset, changes, { colour: 'plain', layers: ['loads', 'supports'], ...view }, new Materials(start.materials));
    this.controls = new Controls(by('groups'), this.state);
    try {
      this.viewer = new Viewer(by('canvas'), start.wave, { antialias: !location.search.includes('hard') });
      this.picking = new Picking(this.viewer, by('lasso').firstElementChild, (...picked) => this.loads.pick(...picked));
      this.loads = new Loads(by('load-list'), this.state, this.viewer, this.picking);
      this.handles = new Handles(by('handles'), this.state, this.viewer, this.picking, (key) => by(key.startsWith('surface') ? 'loads' : 'guides').open);
    } catch (error) {
      this.without(error);
    }
    this.guides = new Guides(by('guide-list'), this.state, this.viewer, this.picking);
    decisions(start.decided);
    this.views = new Views(this);
    this.members = new Members(this);
    this.files = new Files(start, {
      changes: () => this.state.changes,
      opened: (next) => this.opened(next),
      ask: (kind, body) => this.work.ask(kind, body),
      say: (text) => this.notice(text),
    });
    this.making = new Making(start, {
      state: this.state,
      ask: (kind, body) => this.work.ask(kind, body),
      say: (text, calm) => this.notice(text, calm),
      save: () => this.files.save(),
    });
    this.tray = new Tray(start, {
      shown: () => this.shown(),
      back: (next) => this.back(next),
      say: (text) => this.notice(text),
    });
    this.work = new Work({
      solve: (job) => this.solved(job),
      figures: (job) => this.figured(job),
      members: (job) => this.members.hear(job),
      build: (job) => this.making.built(job),
      export: (job) => this.making.built(job),
      picture: (job) => this.pictures?.show(job),
      open: (job) => this.files.read(job),
    });
    this.state.on((keys, final) => this.changed(keys, final));
    follow((changes) => this.state.become(changes));
    this.wire();
  }

  /** In a browser without WebGL the server draws, and a notice says so. */
  without(error) {
    this.viewer = null;
    this.pictures = new Pictures(by('canvas'), by('drawn'), (changes) => this.work.ask('picture', changes));
    this.standing = `${error.message}: the server draws the picture instead.`;
    this.notice('');
  }

  wire() {
    if (this.picking) this.picking.begun = () => [this.loads, this.guides].forEach((list) => list.refresh());
    for (const id of ['loads', 'guides']) by(id).addEventListener('toggle', () => this.handles?.refresh());
    by('undo').addEventListener('click', () => this.state.undo());
    by('redo').addEventListener('click', () => this.state.redo());
    this.views.wire();
    document.addEventListener('keydown', (event) => keyed(event, this));
    new ResizeObserver(() => {
      this.viewer?.resize();
      histogram();
    }).observe(by('picture'));
    this.viewer?.canvas.addEventListener('pointerup', () => this.remember());
    this.viewer?.canvas.addEventListener('wheel', () => this.remember(), { passive: true });
  }

  async begin() {
    this.viewer?.resize();
    early.then((got) => this.found(got));
    await this.work.listen();
    this.solve();
    this.refresh();
  }

  /** Show the design that was solved before the page loaded; the page's own request follows. */
  found(got) {
    if (!got || this.model || got.facts.opening !== this.start.opening) return;
    this.model = got;
    this.stale = true;
    this.surface();
    outdated(!this.stripes());
  }

  /** After a change of the preset: draw as much as possible at once, and request the rest from the server. */
  changed(keys, final) {
    this.refresh(keys);
    if (final) this.remember();
    if (keys?.every((key) => UNSEEN.test(key))) return;
    this.stale = true;
    const live = keys?.every((key) => key.startsWith('pattern.')) && this.stripes();
    if (!live) outdated(true);
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.solve(), live && !final ? REST : WAIT);
  }

  refresh(keys = null) {
    this.controls.refresh();
    this.making.refresh();
    if (!keys || keys.some((key) => key.startsWith('surface.'))) this.loads?.refresh();
    if (!keys || keys.some((key) => key.startsWith('pattern.'))) this.guides.refresh();
    this.handles?.refresh();
    by('undo').disabled = !this.state.past.length;
    by('redo').disabled = !this.state.future.length;
  }

  /** Draw the current stripes; return whether that was possible without the server. */
  stripes() {
    if (!this.model) return false;
    const made = drawn(this.state.preset.pattern, this.model, this.sampler);
    if (!made) return false;
    this.cut = null;
    const turned = String(made.mode) !== String(this.mode);
    this.mode = made.mode;
    this.viewer?.stripes(made);
    if (turned) this.views.colours();
    estimated(made.share, this.model.facts);
    return true;
  }

  solve() {
    this.work.ask('solve', { changes: this.state.changes });
  }

  async solved({ job, state, text }) {
    if (state === 'failed') {
      this.notice(text);
      unknown();
      return;
    }
    if (state !== 'done') return;
    this.notice('');
    const got = await fetched(this.model?.facts.version ?? 0);
    const { facts, arrays } = got;
    if (job !== this.work.latest.solve) return; // a newer job follows
    this.model = facts.whole ? got : { facts: { ...this.model.facts, ...facts }, arrays: { ...this.model.arrays, ...arrays } };
    this.model.facts.opening = this.start.opening;
    if (facts.whole) this.surface();
    const there = !facts.whole && this.cut === facts.draft; // the early model has its measures already
    outdated(!there && !this.stripes());
    this.stale = false;
    notes(facts.notes);
    refused(facts.refused);
    this.figures(); // adds measures of the cut sheet
    this.pictures?.ask(this.state.changes);
    this.done = job; // the picture shows the result of this job
  }

  surface() {
    const first = this.viewer?.model(this.model);
    this.guides.refresh(); // the form knows the size now
    this.handles?.refresh();
    this.sampler = new Sampler(this.model.facts, this.model.arrays);
    this.controls.build(this.model.facts.controls);
    if (first) {
      this.viewer.resize();
      this.views.look('iso', false);
      this.viewer.eye.numbers = this.state.view.eye;
      by('parallel').setAttribute('aria-pressed', String(this.viewer.eye.camera === this.viewer.eye.parallel));
    }
    this.mode = this.model.facts.mode;
    this.views.paint();
  }

  figured({ state, result, text }) {
    if (state === 'failed') {
      this.notice(text);
      this.told = { draft: this.model?.facts.draft, failed: true };
    }
    if (state === 'done') this.told = result;
    if (['done', 'failed'].includes(state)) this.figures();
  }

  /** Show measures once both they and their model have arrived, in either order. */
  figures() {
    if (this.stale || this.told?.draft !== this.model?.facts.draft) return;
    if (!this.told.failed) {
      measured(this.told);
      notes([...this.model.facts.notes, ...this.told.notes]);
      this.settle(this.told.draft);
    }
    if (isMeasure(this.state.view.colour)) this.views.colours(); // its values have changed
    for (const done of this.asking.splice(0)) done();
  }

  /** Draw the cut sheet in place of its stripes, unless these have changed again. */
  async settle(draft) {
    if (!this.viewer || draft === this.cut) return;
    const got = await cut(draft);
    if (!got || this.stale || draft !== this.model.facts.draft) return;
    this.viewer.settle(got);
    this.cut = draft;
  }

  /** Promise of the current design with its measures: { changes, picture, figures }. */
  async shown() {
    if (this.stale || this.told?.draft !== this.model?.facts.draft) await new Promise((done) => this.asking.push(done));
    const picture = this.viewer?.snapshot() ?? by('drawn').src;
    return { changes: this.state.changes, picture, figures: this.told.failed ? null : this.told };
  }

  /** Show a variant again. */
  back(start) {
    if (start.opening === this.start.opening) this.state.become(start.changes);
    else this.opened(start);
  }

  /** Show another preset. */
  opened(start) {
    this.start = start;
    this.state.open(start.preset, start.changes);
    unknown();
    this.state.view = { ...this.state.view, eye: undefined, section: undefined };
    by('section-axis').value = '';
    by('built').replaceChildren();
    this.files.list(start);
    decisions(start.decided);
    this.changed(null, true);
  }

  notice(text, calm = false) {
    notice(text || this.standing || '', calm || !text);
  }

  /** Store the state, so that a reload or a bookmark restores it. */
  remember() {
    clearTimeout(this.keeping);
    this.keeping = setTimeout(() => {
      if (this.viewer && this.model?.facts.opening === this.start.opening) this.state.view.eye = this.viewer.eye.numbers;
      keep(this.state, this.start.title);
    }, 200);
  }
}

const editor = new Editor(await begun());
window.dsfab = editor; // for tests and for the console
editor.begin();
