/** Materials by name: what [statics] takes from them where it does not say otherwise (dsfab/preset_material.py). */

const KEYS = ['young', 'poisson', 'density', 'strength'];
const WORDS = { young: 'stiffness', poisson: 'Poisson’s ratio', density: 'density', strength: 'strength' };

export class Materials {
  /** known: by name, the values of KEYS, and `says`: how the strength was found. */
  constructor(known) {
    this.known = known;
  }

  /** The preset with what a material among the changes gives; values of the old one go. */
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

  /** What is said of the material of [statics], and in which words its values differ from it. */
  told(statics) {
    const values = this.known[statics.material];
    if (!values) return { says: 'Stiffness, weight and strength of a material by its name.', differing: [] };
    const differing = KEYS.filter((key) => values[key] !== statics[key]).map((key) => WORDS[key]);
    return { says: `Strength: ${values.says}.`, differing };
  }
}

const picked = (values) => Object.fromEntries(KEYS.map((key) => [key, values[key]]));
