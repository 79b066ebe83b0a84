/** Jobs on the server: what runs, how far it is, and who waits for its end. */

import { AWAY, listen, post } from './transport.js';

const by = (id) => document.getElementById(id);

export class Work {
  /** Handlers by kind are called with the job when it is done or has failed. */
  constructor(handlers) {
    this.handlers = handlers;
    this.latest = {};
    this.told = {};
    by('cancel').addEventListener('click', () => this.running && post('cancel', { job: this.running }).catch((error) => this.say(error.message)));
  }

  /** Begin to listen. */
  listen() {
    return listen(
      (news) => this.hear(news),
      (away) => (away ? this.say(AWAY) : by('status').textContent === AWAY && this.say('')),
    );
  }

  /** Ask for a job; only the news of the newest of each kind counts. Returns its number. */
  async ask(kind, body) {
    this.latest[kind] = Infinity; // whatever is heard of older ones is old
    try {
      const { job } = await post(kind, body);
      this.latest[kind] = job;
      if (this.told[job]) this.hear(this.told[job]); // it was faster than the answer
      return job;
    } catch (error) {
      this.latest[kind] = 0;
      this.handlers[kind]({ state: 'failed', text: error.message, result: {} });
      return 0;
    }
  }

  hear(news) {
    const { job, kind, state } = news;
    this.told = Object.fromEntries([...Object.entries(this.told).slice(-20), [job, news]]);
    if (kind !== 'figures' && this.latest[kind] !== job) return;
    if (state === 'running') this.show(news);
    if (state === 'waiting') return;
    if (state === 'done' || state === 'failed' || state === 'cancelled') {
      if (this.running === job) this.rest();
      this.handlers[kind](news);
    }
  }

  show({ job, stage, text }) {
    if (this.running !== job) {
      this.rest();
      this.soon = setTimeout(() => this.open(), 250); // what is quick needs no sign
    }
    this.running = job;
    this.doing = stage ? `${stage}: ${text}` : 'working';
    if (!by('progress').hidden) this.say(this.doing);
  }

  open() {
    by('progress').hidden = false;
    by('cancel').hidden = false;
    this.say(this.doing);
  }

  rest() {
    this.running = 0;
    clearTimeout(this.soon);
    by('progress').hidden = true;
    by('cancel').hidden = true;
    this.say('');
  }

  say(text) {
    by('status').textContent = text;
  }
}
