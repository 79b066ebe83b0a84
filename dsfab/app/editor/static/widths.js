/** Half-widths of stripes at the vertices, by the rules of dsfab/pattern/widths.py, and the factor for a solid fraction. */

const STEPS = 40;
const AROUND = 1.2; // a step of a slider usually changes the factor by less

/** Return the function from a factor to half-widths (n, 2) in periods; 0 for a hidden family. Terms without the factor are computed
 * once, because each step of a slider calls it a dozen times. */
export function halfWidths(rule, plain, frequency, arrays, n) {
  const sizes = asked(rule, plain, frequency, arrays, n);
  const { base, low, high, gap } = sizes;
  const { shares } = arrays; // for evenly spaced stripes, whose periods differ on both sides of a line
  const limits = rule.rule === 'constant' ? rule.closing : rule.following;
  const medians = shares && rule.rule !== 'plain' ? mediansOf(sizes, n) : null;
  return (factor, half = new Float32Array(2 * n)) => {
    const most = medians?.(factor).map((usual) => Math.max(rule.open, rule.closer * Math.min(usual, rule.solid)));
    for (let i = 0; i < 2 * n; i += 1) {
      let d = Math.max(Math.min(factor * base[i], high[i]), low[i]);
      if (most) d = crowded(d, most[i % 2], limits, rule.solid);
      half[i] = !rule.drawn[i % 2] ? 0 : d + gap[i] > rule.solid ? rule.solid : d * (shares ? shares[i] : 1);
    }
    return half;
  };
}

/** Before narrow gaps are closed: (n, 2) half-widths at factor 1, their bounds, and half of the least gap, in periods. */
function asked(rule, plain, frequency, { slope, along }, n) {
  const [base, low, high, gap] = Array.from({ length: 4 }, () => new Float32Array(2 * n));
  const graded = rule.rule === 'graded' || rule.rule === 'stressed';
  for (let i = 0; i < 2 * n; i += 1) {
    const lines = slope[i] * frequency[i % 2];
    if (rule.rule === 'constant') base[i] = lines * (rule.member / 2);
    else base[i] = plain[i % 2] * (graded ? along[i] ** rule.q : 1);
    low[i] = lines * (rule.min_width / 2);
    high[i] = rule.max_width ? lines * (rule.max_width / 2) : Infinity;
    gap[i] = lines * (rule.min_gap / 2);
  }
  return { base, low, high, gap, bounded: Boolean(rule.min_width || rule.max_width) };
}

/** Limit a half-width to `most`. Between from and to times `most` it closes the opening instead, so that no slit remains. */
function crowded(d, most, [from, to], solid) {
  const closed = Math.min(Math.max((d / most - from) / (to - from), 0), 1);
  return Math.min(d, most) + closed * (solid - Math.min(d, most));
}

/** Return the function from a factor to the medians of both families; without bounds, multiples of those at 1. */
function mediansOf({ base, low, high, bounded }, n) {
  const column = new Float32Array(n);
  const at = (factor) => [0, 1].map((k) => {
    for (let i = 0, j = k; i < n; i += 1, j += 2) column[i] = Math.max(Math.min(factor * base[j], high[j]), low[j]);
    return median(column);
  });
  if (bounded) return at;
  const one = at(1);
  return (factor) => one.map((d) => factor * d);
}

/** Return the median of an array in linear time; reorders the array [Hoare 1961, Find]. */
export function median(values) {
  const [low, high] = [(values.length - 1) >> 1, values.length >> 1];
  const first = selected(values, low);
  if (low === high) return first;
  let next = Infinity; // the least of the values that are not smaller
  for (let i = high; i < values.length; i += 1) next = Math.min(next, values[i]);
  return (first + next) / 2;
}

/** Partition an array about the value of rank k, and return that value. */
function selected(values, k) {
  let [left, right] = [0, values.length - 1];
  while (left < right) {
    const pivot = values[(left + right) >> 1];
    let [i, j] = [left, right];
    while (i <= j) {
      while (values[i] < pivot) i += 1;
      while (values[j] > pivot) j -= 1;
      if (i <= j) {
        [values[i], values[j]] = [values[j], values[i]];
        i += 1;
        j -= 1;
      }
    }
    if (k <= j) right = j;
    else if (k >= i) left = i;
    else return values[k];
  }
  return values[k];
}

/** Find the factor at which a monotonic share reaches the wanted one, or comes nearest, from `start`.
 *
 * Between two factors on both sides of it by regula falsi, halved where an end stays [the Illinois rule; Dowell and Jarratt 1971].
 * close: tolerance of the share.
 */
export function solved(share, wanted, start, close) {
  let [low, high] = [start / AROUND, start * AROUND];
  let [under, over] = [share(low) - wanted, share(high) - wanted];
  for (let k = 0; k < 30 && over < 0; k += 1) [low, under, high, over] = [high, over, 2 * high, share(2 * high) - wanted];
  for (let k = 0; k < 30 && under > 0; k += 1) [high, over, low, under] = [low, under, low / 2, share(low / 2) - wanted];
  if (over < 0 || under > 0) return over < 0 ? high : low;
  let side = 0;
  for (let k = 0; k < STEPS && high - low > 1e-4 * high; k += 1) {
    const between = over > under ? low - (under * (high - low)) / (over - under) : (low + high) / 2;
    const factor = k % 4 === 3 ? (low + high) / 2 : between; // bisection, because a share with jumps converges slowly
    const value = share(factor) - wanted;
    if (Math.abs(value) <= close) return factor;
    if (value < 0) {
      [low, under] = [factor, value];
      if (side < 0) over /= 2;
      side = -1;
    } else {
      [high, over] = [factor, value];
      if (side > 0) under /= 2;
      side = 1;
    }
  }
  return (low + high) / 2;
}
