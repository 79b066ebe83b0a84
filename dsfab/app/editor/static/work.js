/** Jobs on the server: their progress, and handlers of their end. */

import { AWAY, listen, post } from './transport.js';

const RANK = ['open', 'build', 'export', 'picture', 'solve', 'figures']; // the first running kind shows its progress

const by = (id) => document.getElementById(id);

export class Work {
  /** Handlers by kind are called with the job when it is done or has failed. */
  constructor(handlers) {
    this.handlers = handlers;
    this.latest = {};
    this.told = {};
    this.running = new Map();
    by('cancel').addEventListener('click', () => this.shown && post('cancel', { job: this.shown.job }).catch((error) => this.say(error.message)));
  }

  /** Begin to listen. */
  listen() {
    return listen(
      (news) => this.hear(news),
      (away) => (away ? this.say(AWAY) : by('status').textContent === AWAY && this.say('')),
    );
  }

  /** Start a job; records of older jobs of its kind are ignored. Returns the answer: its number, or a question. */
  async ask(kind, body) {
    this.latest[kind] = Infinity; // ignores records of older jobs
    try {
      const answer = await post(kind, body);
      this.latest[kind] = answer.job ?? 0;
      if (this.told[answer.job]) this.hear(this.told[answer.job]); // its record arrived before the answer
      return answer;
    } catch (error) {
      this.latest[kind] = 0;
      this.handlers[kind]({ state: 'failed', text: error.message, result: {} });
      return {};
    }
  }

  hear(news) {
    const { job, kind, state } = news;
    this.told = Object.fromEntries([...Object.entries(this.told).slice(-20), [job, news]]);
    if (kind !== 'figures' && this.latest[kind] !== job) return;
    if (state === 'waiting') return;
    if (state === 'running') this.running.set(kind, news);
    else if (this.running.get(kind)?.job === job) this.running.delete(kind);
    this.show();
    if (state !== 'running') this.handlers[kind](news);
  }

  /** The running job whose progress the page shows. */
  get shown() {
    return RANK.map((kind) => this.running.get(kind)).find(Boolean);
  }

  show() {
    const { shown } = this;
    if (!shown) return this.rest();
    this.soon ??= setTimeout(() => this.open(), 250); // short jobs show no progress
    if (!by('progress').hidden) this.say(said(shown));
    return undefined;
  }

  open() {
    by('progress').hidden = false;
    by('cancel').hidden = false;
    this.show();
  }

  rest() {
    clearTimeout(this.soon);
    this.soon = null;
    by('progress').hidden = true;
    by('cancel').hidden = true;
    this.say('');
  }

  say(text) {
    by('status').textContent = text;
  }
}

const said = ({ stage, text }) => (stage ? `${stage}: ${text}` : 'working');
