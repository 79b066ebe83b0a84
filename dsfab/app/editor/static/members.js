/** Members of the current design: name under the pointer, and colours by their measures. */

import { told } from './looks.js';

const WITHIN = 1.1; // times a member's reach from its middle, because the mesh is coarser than its edges
const REST = 150; // milliseconds from the last move to a request for the members

const by = (id) => document.getElementById(id);
const MEASURES = {
  length: { title: 'length of members', words: (value) => told(value, 'm') },
  curvature: { title: 'largest curvature of members', words: (value) => `${Number(value.toPrecision(2))} /m` },
  utilisation: { title: 'used of what members bear', words: (value) => `${Math.round(100 * value)} %` },
};

export const isMeasure = (choice) => choice in MEASURES;

export class Members {
  /** editor: has the model and the viewer. */
  constructor(editor) {
    Object.assign(this, { editor, told: null, asked: '' });
    const canvas = editor.viewer?.canvas;
    canvas?.addEventListener('pointermove', (event) => this.move(event));
    canvas?.addEventListener('pointerleave', () => this.name(null));
    canvas?.addEventListener('pointerdown', () => this.name(null));
  }

  /** The server's members of the current design; null before they arrive. */
  get known() {
    const { facts } = this.editor.model ?? {};
    return this.told && !this.editor.stale && this.told.draft === facts?.draft ? this.told : null;
  }

  /** Request the members once for each design; judged: with their utilisation. */
  ask(judged = false) {
    const { facts } = this.editor.model ?? {};
    const key = `${facts?.opening} ${facts?.draft} ${judged}`;
    if (!facts || this.editor.stale || this.asked === key || (this.known && (this.known.judged || !judged))) return;
    this.asked = key;
    this.editor.work.ask('members', { judged });
  }

  /** Handle the end of such a job. */
  hear({ state, result, text }) {
    if (state === 'failed') this.editor.notice(text);
    if (state !== 'done') return;
    this.told = result;
    this.editor.views.colours();
  }

  move(event) {
    clearTimeout(this.later);
    const { picking } = this.editor;
    if (event.buttons || picking.kind) return this.name(null);
    if (!this.known) {
      this.later = setTimeout(() => this.ask(), REST);
      return this.name(null);
    }
    const at = picking.hit(event);
    return this.name(at && this.at(at), event);
  }

  /** The member at a place of the surface, or null in an opening. */
  at({ x, y, z }) {
    let [best, chosen] = [WITHIN, null];
    for (const member of this.known.members) {
      const { places, reach } = member;
      for (let i = 0; i < places.length; i += 3) {
        const away = Math.hypot(places[i] - x, places[i + 1] - y, places[i + 2] - z) / reach;
        if (away < best) [best, chosen] = [away, member];
      }
    }
    return chosen;
  }

  /** Show the name of a member beside the pointer, or none. */
  name(member, event) {
    const sign = by('member');
    sign.hidden = !member;
    if (!member) return;
    sign.textContent = `${member.id} · ${member.length ? `${told(member.length, 'm')} long, ` : ''}${told(member.width, 'm')} wide`;
    sign.style.left = `${event.offsetX + 14}px`;
    sign.style.top = `${event.offsetY + 12}px`;
  }

  /** As looks.colouring, by a measure of members; null without members or without values. */
  colouring(choice, families, ramp) {
    const judged = choice === 'utilisation';
    this.ask(judged);
    if (!this.known || (judged && !this.known.judged)) return null;
    const { members, nearest } = this.known;
    const all = members.map((member) => member[choice]).filter((value) => value !== null);
    if (!all.length) return null;
    const [least, most] = [Math.min(...all), Math.max(...all, 1e-9)];
    const values = Float32Array.from(nearest, (k) => members[k][choice] ?? least);
    const { title, words } = MEASURES[choice];
    const how = { families, values, limit: most, low: least / most, ramp };
    return [how, { title, low: words(least), high: words(most), ramp }];
  }
}
