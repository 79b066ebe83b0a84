/** Special rows of the form: lists of words, three lengths, and the material. */

import { make, short } from './controls.js';

/** Rows by the kind of a control; they set `state`. */
export const ROWS = {
  words: (control, state) => text(control, state, (list) => list.join(', '), (written) => written.split(',').map((word) => word.trim()).filter(Boolean)),
  size: (control, state) => text(control, state, (list) => (list ?? []).map(short).join(' × '), lengths),
  material,
};

/** A text field; `read` returns undefined for an invalid value. */
function text(control, state, show, read) {
  const id = control.key.replaceAll('.', '-');
  const field = make('input', { type: 'text', id, autocomplete: 'off', spellcheck: false, placeholder: 'none' });
  const refresh = (value) => (field.value = show(value));
  field.addEventListener('change', () => {
    const value = read(field.value.trim());
    if (value === undefined) refresh(state.get(control.key));
    else state.set({ [control.key]: value });
  });
  const element = make('div', { className: 'row', title: control.hint });
  element.append(make('label', { htmlFor: id, textContent: control.label }), field, make('span', { className: 'unit', textContent: control.unit }));
  element.classList.add('wide');
  return { control, element, inputs: [field], refresh };
}

/** '0.25 x 0.21 x 0.2' as three numbers, null for an empty field. */
function lengths(written) {
  if (!written) return null;
  const parts = written.split(/\s*[x×;]\s*|\s+/).map((part) => Number(part.replace(',', '.')));
  return parts.length === 3 && parts.every((part) => part > 0 && Number.isFinite(part)) ? parts : undefined;
}

/** A list of materials, and which values are not those of the chosen one. */
function material(control, state) {
  const id = control.key.replaceAll('.', '-');
  const select = make('select', { id });
  const own = make('p', { className: 'own', id: `${id}-own` });
  select.setAttribute('aria-describedby', own.id);
  select.addEventListener('change', () => state.set(state.materials.chosen(state.preset.statics, select.value)));
  const element = make('div', { className: 'row' });
  element.append(make('label', { htmlFor: id, textContent: control.label }), select, own);
  const refresh = (value) => {
    const unnamed = !state.base.statics.material || !value; // to go back to values without a name
    const names = unnamed ? ['', ...control.choices] : control.choices;
    if (select.length !== names.length) select.replaceChildren(...names.map((name) => make('option', { value: name, textContent: name || 'own values' })));
    select.value = value ?? '';
    const { says, differing } = state.materials.told(state.preset.statics);
    own.textContent = differing.length ? `your own ${differing.join(', ')}` : '';
    own.hidden = !differing.length;
    control.hint = says;
  };
  return { control, element, inputs: [select], refresh };
}
