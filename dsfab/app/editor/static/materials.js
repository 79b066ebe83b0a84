/** Materials by name: default values of [statics] (dsfab/core/materials.py). */

const KEYS = ['young', 'poisson', 'density', 'strength'];
const WORDS = { young: 'stiffness', poisson: 'Poisson’s ratio', density: 'density', strength: 'strength' };

export class Materials {
  /** known: by name, the values of KEYS, and `says`: origin of the strength. */
  constructor(known) {
    this.known = known;
  }

  /** The preset with the values of a changed material; values of the old one are removed. */
  implied(preset, changes) {
    const values = this.known[changes['statics.material']];
    if (!values) return preset;
    return { ...preset, statics: { ...preset.statics, ...picked(values) } };
  }

  /** Changes that choose a material, or '' for the same values without its name. */
  chosen(statics, name) {
    const values = picked(this.known[name] ?? statics);
    return { 'statics.material': name || null, ...Object.fromEntries(KEYS.map((key) => [`statics.${key}`, values[key]])) };
  }

  /** Remark on the material of [statics], and words for values that differ from it. */
  told(statics) {
    const values = this.known[statics.material];
    if (!values) return { says: 'Stiffness, weight and strength of a material by its name.', differing: [] };
    const differing = KEYS.filter((key) => values[key] !== statics[key]).map((key) => WORDS[key]);
    return { says: `Strength: ${values.says}.`, differing };
  }
}

const picked = (values) => Object.fromEntries(KEYS.map((key) => [key, values[key]]));
