/** Widths of stripes and their share of the surface, fast enough for each frame of a slider's drag.
 *
 * The rules are those of dsfab/pattern/widths.py, and their numbers come with the model (facts.widthRules, WIDTH_RULES in
 * dsfab/pattern/layers.py); the server's own numbers replace these a moment later. The
 * rule stressed solves on the cut sheet; here it shows its first widths, those of the rule graded.
 */

import { alike } from './state.js';
import { halfWidths, solved } from './widths.js';

const POINTS = 20000;
const BESIDE = 1e-9; // metres: a reach that has no effect, because the shader needs a number

/** Values of the shader for a preset's [pattern]: { mode, frequency, phase, plain, half, reach, share }.
 *
 * model: facts and arrays of the server. plain: half-widths in periods, one for each family; half: (n, 2) where they
 * vary over the surface, or null. Returns null if only the server can tell: another mode with varying widths, another
 * method, or evenly spaced stripes of another spacing.
 */
export function drawn(pattern, model, sampler) {
  const { facts } = model;
  const cut = facts.pattern?.region;
  if (cut && !alike(pattern.region, cut)) return null; // the surface is cut along them
  if (pattern.method !== facts.method && !alike(pattern, facts.pattern)) return null; // another method, or an automatic choice
  const told = facts.method === 'stripes' ? even(pattern, facts) : waves(pattern, facts);
  if (!told) return null;
  const regions = pattern.region?.some((region) => region.do !== 'void');
  const reach = [pattern.keep || (regions ? BESIDE : -1e30), pattern.rim || -1e30];
  return wide(pattern, { ...told, reach }, model, sampler);
}

/** Place of evenly spaced stripes: the phases of the server, if they belong to this pattern. */
function even(pattern, { pattern: made }) {
  if (!alike(placed(pattern), placed(made))) return null;
  return { mode: [1, 1], frequency: [1, 1], phase: [0, 0] };
}

/** The keys of a pattern that decide the place of evenly spaced stripes. */
function placed({ keep, rim, fillet, tidy, width, ...pattern }) {
  const family = ({ mode, frequency, phase, threshold, ...rest }) => rest;
  return { ...pattern, major: family(pattern.major), minor: family(pattern.minor) };
}

/** Place of stripes on modes. */
function waves(pattern, facts) {
  const pair = [pattern.major, pattern.minor];
  const mode = pair.map((family, k) => (family.mode === 'auto' ? facts.mode[k] : family.mode));
  const phase = pair.map((family, k) => (family.phase === 'auto' ? facts.phase[k] : family.phase));
  const names = ['major', 'minor'];
  if (mode.some((number, k) => number > facts.lines[names[k]].length)) return null;
  const frequency = pair.map((family, k) => family.frequency || facts.lines[names[k]][mode[k] - 1] / family.spacing);
  return { mode, phase: phase.map((p) => p - Math.floor(p)), frequency };
}

/** Widths of the stripes. */
function wide(pattern, told, { facts, arrays }, sampler) {
  const model = { facts, arrays };
  const { mode, frequency, phase, reach } = told;
  const width = pattern.width;
  const drawn = ['major', 'minor'].map((name) => ['both', name].includes(pattern.families));
  const plain = [pattern.major, pattern.minor].map((family, k) => (drawn[k] ? (1 - family.threshold) / 4 : 0));
  const rules = width.rule !== 'plain' || thinnest(width, facts) > 0 || width.max_width > 0 || width.min_gap > 0;
  if (rules && mode.some((number, k) => number !== facts.mode[k])) return null;
  const vary = rules || Boolean(arrays.shares);
  sampler.look(mode, frequency, phase, reach);
  if (alike(pattern, facts.pattern)) return exact(told, plain, vary, model, sampler);
  const n = arrays.V.length / 3;
  const member = width.member || Math.sqrt(facts.area) / 100;
  const rule = { ...facts.widthRules, ...width, min_width: thinnest(width, facts), member, drawn };
  const varying = vary && halfWidths(rule, plain, frequency, arrays, n);
  const halves = (factor, into) => (vary ? varying(factor, into) : plain.map((d) => Math.min(factor * d, rule.solid)));
  const factor = scale(width, facts, halves, sampler, vary && new Float32Array(2 * n));
  const half = halves(factor);
  return { ...told, plain: vary ? plain : half, half: vary ? half : null, share: sampler.share(half) };
}

/** Least width of a member, metres; 0 without a limit. */
function thinnest(width, { least }) {
  if (width.min_width !== 'auto') return width.min_width;
  return ['graded', 'stressed'].includes(width.rule) ? Math.min(least, width.max_width || least) : 0;
}

/** Factor on the widths: solved for the solid fraction, if any, from the slider's last factor. */
function scale(width, facts, halves, sampler, scratch) {
  if (!width.solid_fraction) return width.rule === 'graded' ? facts.factor : 1;
  sampler.factor = solved((f) => sampler.share(halves(f, scratch)), width.solid_fraction, sampler.factor || facts.factor, 1 / POINTS);
  return sampler.factor;
}

/** The server's own widths. */
function exact(told, plain, vary, model, sampler) {
  const half = vary ? model.arrays.half : plain.map((d) => Math.min(model.facts.factor * d, model.facts.widthRules.solid));
  return { ...told, plain: vary ? plain : half, half: vary ? half : null, share: sampler.share(half) };
}

/** Evenly distributed points of a surface, at which the page counts material. */
export class Sampler {
  constructor(facts, arrays) {
    this.facts = facts;
    this.arrays = arrays;
    this.at = new Uint32Array(3 * POINTS);
    this.weight = new Float32Array(3 * POINTS);
    this.kept = new Uint8Array(POINTS);
    this.told = ['', '', ''];
    this.z = [new Float32Array(POINTS), new Float32Array(POINTS)];
    this.spread();
  }

  /** One point in each POINTS-th of the area, at places of a sequence that fills triangles evenly (Roberts 2018). */
  spread() {
    const { V, F } = this.arrays;
    const sums = new Float64Array(F.length / 3);
    let total = 0;
    for (let f = 0; f < sums.length; f += 1) sums[f] = total += area(V, F, f);
    for (let p = 0, f = 0; p < POINTS; p += 1) {
      while (f < sums.length - 1 && sums[f] < ((p + 0.5) / POINTS) * total) f += 1;
      let a = (0.7548776662466927 * p) % 1;
      let b = (0.5698402909980532 * p) % 1;
      if (a + b > 1) [a, b] = [1 - a, 1 - b];
      for (let c = 0; c < 3; c += 1) this.at[3 * p + c] = F[3 * f + c];
      this.weight.set([1 - a - b, a, b], 3 * p);
    }
  }

  /** Compute phases of both families at the points, in periods, and the points that are always kept; only changes. */
  look(mode, frequency, phase, reach) {
    const n = this.arrays.V.length / 3;
    ['major', 'minor'].forEach((name, s) => {
      const told = `${mode[s]} ${frequency[s]} ${phase[s]}`;
      if (this.told[s] === told) return;
      this.told[s] = told;
      const values = this.interpolated(this.arrays[name].subarray((mode[s] - 1) * n, mode[s] * n), 1, 0);
      for (let p = 0; p < POINTS; p += 1) {
        const z = frequency[s] * values[p] + phase[s];
        this.z[s][p] = Math.abs(z - Math.round(z));
      }
    });
    if (this.told[2] === String(reach)) return;
    this.told[2] = String(reach);
    const [near, rim] = [0, 1].map((s) => this.interpolated(this.arrays.kept, 2, s));
    for (let p = 0; p < POINTS; p += 1) this.kept[p] = near[p] < reach[0] || rim[p] < reach[1];
  }

  /** Values at the points of a field that is linear over faces: every `step`-th number from `first` on. */
  interpolated(field, step, first) {
    const { at, weight } = this;
    const values = new Float32Array(POINTS);
    for (let p = 0, c = 0; p < POINTS; p += 1, c += 3) {
      values[p] = weight[c] * field[step * at[c] + first] + weight[c + 1] * field[step * at[c + 1] + first] + weight[c + 2] * field[step * at[c + 2] + first];
    }
    return values;
  }

  /** The share of the surface that half-widths keep: two numbers, or (n, 2). */
  share(half) {
    const { at, weight, kept } = this;
    const [zu, zw] = this.z;
    let count = 0;
    for (let p = 0; p < POINTS; p += 1) {
      if (kept[p]) count += 1;
      else if (half.length === 2) count += zu[p] < half[0] || zw[p] < half[1];
      else {
        let [u, w] = [0, 0];
        for (let c = 3 * p; c < 3 * p + 3; c += 1) {
          u += weight[c] * half[2 * at[c]];
          w += weight[c] * half[2 * at[c] + 1];
        }
        count += zu[p] < u || zw[p] < w;
      }
    }
    return count / POINTS;
  }
}

function area(V, F, f) {
  const [i, j, k] = [3 * F[3 * f], 3 * F[3 * f + 1], 3 * F[3 * f + 2]];
  const [a, b, c] = [V[j] - V[i], V[j + 1] - V[i + 1], V[j + 2] - V[i + 2]];
  const [d, e, g] = [V[k] - V[i], V[k + 1] - V[i + 1], V[k + 2] - V[i + 2]];
  return Math.hypot(b * g - c * e, c * d - a * g, a * e - b * d) / 2;
}
