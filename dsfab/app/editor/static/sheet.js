/** The drawn surface: its geometry, and a shader with only the parts that the picture needs.
 *
 * During changes the shader cuts the stripes out of the whole surface. Once the server has cut and tidied
 * them, its sheet replaces them: see `cut_sheet_arrays` in drafts.py.
 */

import * as THREE from 'three';
import { fragment, VERTEX } from './shader.js';

export class Sheet extends THREE.Mesh {
  /** wave: line of GLSL from the server; soft: antialiased edges. */
  constructor(wave, soft) {
    super(new THREE.BufferGeometry());
    this.frustumCulled = false;
    this.uniforms = uniforms();
    this.flags = { SOFT: soft };
    this.soft = soft;
    this.sources = { vertexShader: VERTEX, fragmentShader: fragment(wave) };
    this.materials = new Map();
    this.live = this.geometry; // of the whole surface
    this.cut = null; // { geometry, arrays } of the cut sheet
    this.outline = new THREE.LineSegments();
    this.outline.frustumCulled = false;
    this.outline.raycast = () => {}; // lines cannot be picked
    this.add(this.outline);
    this.want({});
  }

  /** Switch parts of the shader on or off, by the names of their #define. */
  want(flags) {
    Object.assign(this.flags, flags);
    this.flags.CUT = Boolean(this.cut) && !this.flags.WHOLE;
    this.geometry = this.flags.CUT ? this.cut.geometry : this.live;
    this.material = this.made(this.flags);
    this.outline.visible = this.flags.CUT;
    if (this.flags.CUT) this.outline.material = this.made({ ...this.flags, EDGE: true, CREASE: false, SOFT: false });
  }

  /** The material with some parts; each is compiled once. */
  made(given) {
    const flags = given.CUT ? { ...given, KEEP: false, VARY: false } : given;
    const names = Object.keys(flags).filter((name) => flags[name]).sort();
    const key = names.join(' ');
    if (!this.materials.has(key)) {
      this.materials.set(key, new THREE.RawShaderMaterial({
        ...this.sources, uniforms: this.uniforms, defines: Object.fromEntries(names.map((name) => [name, ''])),
        glslVersion: THREE.GLSL3, side: THREE.DoubleSide, alphaToCoverage: Boolean(flags.SOFT),
        // a slope offset puts faces behind their outlines, so that these stay visible
        polygonOffset: Boolean(flags.CUT && !flags.EDGE), polygonOffsetFactor: 1, polygonOffsetUnits: 4,
      }));
    }
    return this.materials.get(key);
  }

  /** Run a function while the surface is black with sharp edges; live: use the shader's stripes, not the cut sheet. */
  masked(act, live = false) {
    const { material, geometry } = this;
    const sharp = { MASK: true, SOFT: false, FAMILY: false, VALUE: false, CREASE: false, ...(live && { CUT: false }) };
    this.material = this.made({ ...this.flags, ...sharp });
    if (live) this.geometry = this.live;
    this.outline.visible = false;
    act();
    Object.assign(this, { material, geometry });
    this.outline.visible = this.flags.CUT;
  }

  /** Picking uses the whole surface with its openings. */
  raycast(ray, hits) {
    const { geometry } = this;
    this.geometry = this.live;
    super.raycast(ray, hits);
    this.geometry = geometry;
  }

  /** Show another structure, see `draft_model` in drafts.py. */
  shape({ facts, arrays }) {
    const n = arrays.V.length / 3;
    const made = geometryOf(arrays.F, {
      position: [arrays.V, 3], normal: [arrays.normals, 3], kept: [arrays.kept, 2], moved: [arrays.u, 3],
      modeU: [arrays.major.subarray(0, n), 1], modeW: [arrays.minor.subarray(0, n), 1],
      halfWidth: [arrays.kept, 2], // until widths are known
      value: [arrays.stress, 1],
    });
    this.live.dispose();
    this.live = made;
    this.modes = [1, 1];
    this.arrays = arrays;
    this.uncut();
    this.want({ CREASE: facts.creased });
  }

  /** Draw the server's cut sheet in place of the stripes, see `cut_sheet_arrays` in drafts.py. */
  settle({ arrays }) {
    this.uncut();
    const here = (name) => carried(this.live.getAttribute(name), arrays);
    const geometry = geometryOf(arrays.F, {
      position: [arrays.V, 3], normal: [arrays.normals, 3], tint: [arrays.tint, 1],
      moved: [here('moved'), 3], value: [here('value'), 1],
    });
    this.cut = { geometry, arrays };
    const edges = new THREE.BufferGeometry();
    Object.assign(edges.attributes, geometry.attributes); // the same attributes with an index of lines
    edges.setIndex(new THREE.BufferAttribute(arrays.E, 1));
    this.outline.geometry = edges;
    this.want({});
  }

  /** Remove the cut sheet, because the stripes have changed. */
  uncut() {
    this.cut?.geometry.dispose();
    this.outline.geometry.dispose();
    this.cut = null;
    this.want({});
  }

  /** Set the values of pattern.js. */
  stripes({ mode, frequency, phase, plain, half, reach }) {
    this.uncut();
    const u = this.uniforms;
    u.uFrequency.value = frequency;
    u.uPhase.value = phase;
    u.uReach.value = reach;
    u.uHalf.value = plain;
    if (half) this.put('halfWidth', half);
    this.want({ VARY: Boolean(half), KEEP: reach.some((metres) => metres > 0) });
    const n = this.arrays.V.length / 3;
    ['major', 'minor'].forEach((name, k) => {
      if (this.modes[k] === mode[k]) return;
      this.put(['modeU', 'modeW'][k], this.arrays[name].subarray((mode[k] - 1) * n, mode[k] * n));
      this.modes[k] = mode[k];
    });
  }

  put(name, values) {
    replace(this.live.getAttribute(name), values);
    const there = this.cut?.geometry.getAttribute(name);
    if (there) replace(there, carried(this.live.getAttribute(name), this.cut.arrays));
  }

  /** Set colours: three of families; or values (n,) from low x limit to limit on a ramp [[r, g, b], ...] of bytes. */
  colours({ families, values = null, limit = 1, low = -1, ramp = null, move = 0, byFamily = false }) {
    const u = this.uniforms;
    u.uColours.value = families.map((colour) => new THREE.Vector3(...colour));
    u.uMove.value = move;
    this.want({ VALUE: Boolean(values), FAMILY: byFamily, MOVE: move > 0 });
    if (!values) return;
    this.put('value', values);
    [u.uLimit.value, u.uLow.value] = [limit, low];
    u.uRamp.value?.dispose();
    const bytes = new Uint8Array(ramp.flatMap((rgb) => [...rgb, 255]));
    u.uRamp.value = new THREE.DataTexture(bytes, ramp.length, 1);
    Object.assign(u.uRamp.value, { magFilter: THREE.LinearFilter, minFilter: THREE.LinearFilter, needsUpdate: true });
  }

  /** Hide one side of a plane [a, b, c, d]; null shows all. */
  section(plane) {
    if (plane) this.uniforms.uSection.value = plane;
    this.want({ SECTION: Boolean(plane) });
  }
}

/** Triangles F with columns { name: [array, numbers of each vertex] }. */
function geometryOf(F, columns) {
  const made = new THREE.BufferGeometry();
  made.setIndex(new THREE.BufferAttribute(F, 1));
  for (const [name, [array, size]] of Object.entries(columns)) made.setAttribute(name, new THREE.BufferAttribute(array, size));
  return made;
}

/** Interpolate values at the vertices of the whole surface to those of the cut sheet. */
function carried({ array, itemSize }, { corners, shares }) {
  const found = new Float32Array((corners.length / 3) * itemSize);
  for (let i = 0; i < corners.length; i += 1) {
    const to = Math.trunc(i / 3) * itemSize;
    for (let k = 0; k < itemSize; k += 1) found[to + k] += shares[i] * array[corners[i] * itemSize + k];
  }
  return found;
}

function replace(attribute, values) {
  attribute.array = values;
  attribute.needsUpdate = true;
}

function uniforms() {
  const start = {
    uFrequency: [1, 1], uPhase: [0, 0], uHalf: [0.5, 0.5], uReach: [-1e30, -1e30], uSection: [0, 0, 0, 1],
    uUp: new THREE.Vector3(0, 1, 0), uColours: [0, 1, 2].map(() => new THREE.Vector3(1, 1, 1)),
    uRamp: null, uLimit: 1, uLow: -1, uMove: 0,
  };
  return Object.fromEntries(Object.entries(start).map(([name, value]) => [name, { value }]));
}
