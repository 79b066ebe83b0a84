/** The user's changes: dotted keys and values over a preset, with undo, stored in the address bar. */

const DEEP = 200;

export class State {
  /** base: the preset as nested objects; changes: dotted keys and values; materials: see materials.js. */
  constructor(base, changes = {}, view = {}, materials = null) {
    this.listeners = [];
    this.materials = materials;
    this.view = view;
    this.open(base, changes);
  }

  /** Take another preset; the undo history belongs to the old one. */
  open(base, changes = {}) {
    this.base = base;
    this.changes = { ...changes };
    this.past = [];
    this.future = [];
    this.settled = this.changes;
    this.made = null;
  }

  /** Call `hear(keys, final)` after every change; keys is null when everything may have changed. */
  on(hear) {
    this.listeners.push(hear);
  }

  /** The preset with all changes; do not modify it. */
  get preset() {
    this.made ??= applied(this.usual(this.changes), this.changes);
    return this.made;
  }

  /** The preset before changes, with the values that they imply. */
  usual(changes) {
    return this.materials?.implied(this.base, changes) ?? this.base;
  }

  /** The value at a dotted key. */
  get(key) {
    return at(this.preset, key);
  }

  /** Set values; `final` marks the end of a drag, which is one step of undo. */
  set(values, final = true) {
    const changes = { ...this.changes };
    for (const [key, value] of Object.entries(values)) {
      for (const old of Object.keys(changes)) if (old.startsWith(`${key}.`)) delete changes[old];
      const parent = Object.keys(changes).find((old) => key.startsWith(`${old}.`));
      if (parent) changes[parent] = applied(changes[parent], { [key.slice(parent.length + 1)]: value });
      else if (same(at(this.usual(changes), key), value)) delete changes[key];
      else changes[key] = value;
    }
    this.changes = changes;
    if (final) this.settle();
    this.tell(Object.keys(values), final);
  }

  /** Replace all changes, as one step of undo. */
  become(changes) {
    const keys = differing(changes, this.changes);
    if (!keys.length) return;
    this.changes = { ...changes };
    this.settle();
    this.tell(keys, true);
  }

  /** Record the changes since the last step as one step of undo. */
  settle() {
    if (same(this.settled, this.changes)) return;
    this.past = [...this.past.slice(-DEEP), this.settled];
    this.future = [];
    this.settled = this.changes;
  }

  undo() {
    this.step(this.past, this.future);
  }

  redo() {
    this.step(this.future, this.past);
  }

  step(from, to) {
    if (!from.length) return;
    const keys = differing(this.changes, from.at(-1));
    to.push(this.changes);
    this.changes = from.pop();
    this.settled = this.changes;
    this.tell(keys, true);
  }

  tell(keys, final) {
    this.made = null;
    for (const hear of this.listeners) hear(keys, final);
  }

  /** The state as a line for the address bar: the preset's name, the changes, and `view` after a tilde. */
  hash(title) {
    const words = new URLSearchParams({ preset: title });
    for (const [key, value] of Object.entries(this.changes)) words.set(key, JSON.stringify(value));
    for (const [key, value] of Object.entries(this.view)) words.set(`~${key}`, JSON.stringify(value));
    return `#${words}`;
  }
}

/** Content of a hash: { title, changes, view }, without unreadable parts. */
export function fromHash(hash) {
  const found = { title: '', changes: {}, view: {} };
  for (const [key, text] of new URLSearchParams(hash.replace(/^#/, ''))) {
    if (key === 'preset') found.title = text;
    else {
      try {
        if (key.startsWith('~')) found.view[key.slice(1)] = JSON.parse(text);
        else found.changes[key] = JSON.parse(text);
      } catch {
        // the user edited the address, and the rest of it is still valid
      }
    }
  }
  return found;
}

const at = (values, key) => key.split('.').reduce((where, part) => where?.[part], values);
export const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

/** Whether two values are equal in a preset, regardless of the order of keys and of explicit defaults. */
export const alike = (a, b) => JSON.stringify(a, sorted) === JSON.stringify(b, sorted);

const UNSAID = new Set(['relative', 'boundary']); // keys of a picker that are false by default

function sorted(_, value) {
  if (value === null || typeof value !== 'object' || Array.isArray(value)) return value;
  return Object.fromEntries(Object.entries(value).filter(([key, part]) => part !== null && part !== '' && !(UNSAID.has(key) && part === false)).sort(([a], [b]) => (a < b ? -1 : 1)));
}

/** The keys at which two sets of changes differ. */
const differing = (a, b) => Object.keys({ ...a, ...b }).filter((key) => !same(a[key], b[key]));

/** A copy of nested values with others at dotted keys; numbers in a key index lists. */
function applied(values, changes) {
  const copy = structuredClone(values);
  for (const [key, value] of Object.entries(changes)) {
    const parts = key.split('.');
    const last = parts.pop();
    let where = copy;
    for (const part of parts) where = where[part] ??= {};
    where[last] = structuredClone(value);
  }
  return copy;
}
