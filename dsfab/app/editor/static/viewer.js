/** Draws a structure; knows nothing of sliders, servers or presets. */

import * as THREE from 'three';
import { Eye } from './camera.js';
import { Ground } from './ground.js';
import { Marks } from './marks.js';
import { fragment, VERTEX } from './shader.js';

THREE.ColorManagement.enabled = false; // colours are meant as they are written

const CALM = 140; // milliseconds without a change, after which the shadow follows

export class Viewer {
  /** canvas; wave: the line of GLSL that all of dsfab shares. Throws where there is no WebGL2. */
  constructor(canvas, wave, { antialias = true } = {}) {
    const context = canvas.getContext('webgl2', { alpha: false, antialias });
    if (!context) throw new Error('this browser has no WebGL2');
    this.gl = context;
    this.renderer = new THREE.WebGLRenderer({ canvas, context });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.renderer.autoClear = false;
    this.canvas = canvas;
    this.scene = new THREE.Scene();
    this.uniforms = uniforms(antialias);
    const material = new THREE.RawShaderMaterial({
      uniforms: this.uniforms, vertexShader: VERTEX, fragmentShader: fragment(wave),
      glslVersion: THREE.GLSL3, side: THREE.DoubleSide, alphaToCoverage: antialias,
    });
    this.sheet = new THREE.Mesh(new THREE.BufferGeometry(), material);
    this.sheet.frustumCulled = false;
    this.ground = new Ground(this.sheet);
    this.marks = new Marks();
    this.scene.add(this.ground.plane, this.sheet, this.marks.group);
    this.eye = new Eye(canvas, () => this.due());
    this.frames = 0;
    canvas.addEventListener('webglcontextrestored', () => this.due());
  }

  /** Another structure, see payload.py. */
  model(model) {
    const { facts, arrays } = model;
    this.data = model;
    const n = arrays.V.length / 3;
    const shape = new THREE.BufferGeometry();
    const add = (name, array, size) => shape.setAttribute(name, new THREE.BufferAttribute(array, size));
    shape.setIndex(new THREE.BufferAttribute(arrays.F, 1));
    add('position', arrays.V, 3);
    add('normal', arrays.normals, 3);
    add('kept', arrays.kept, 2);
    add('moved', arrays.u, 3);
    add('modeU', arrays.major.subarray(0, n), 1);
    add('modeW', arrays.minor.subarray(0, n), 1);
    add('halfWidth', new Float32Array(2 * n), 2);
    add('value', new Float32Array(n), 1);
    this.sheet.geometry.dispose();
    this.sheet.geometry = shape;
    this.modes = [1, 1];
    this.marks.place(model);
    this.ground.place(model);
    this.shadowDue = true;
    const first = !this.title || this.title !== facts.opening;
    this.title = facts.opening;
    this.eye.size === undefined || first ? this.eye.look(model) : Object.assign(this.eye, { points: arrays.V, size: facts.size });
    return first;
  }

  /** What pattern.js makes of a pattern. */
  stripes({ mode, frequency, phase, plain, half, reach }) {
    const u = this.uniforms;
    u.uFrequency.value = frequency;
    u.uPhase.value = phase;
    u.uReach.value = reach;
    u.uHalf.value = half ? [-1, -1] : plain;
    if (half) this.put('halfWidth', half);
    const n = this.data.arrays.V.length / 3;
    ['major', 'minor'].forEach((name, k) => {
      if (this.modes[k] === mode[k]) return;
      this.put(['modeU', 'modeW'][k], this.data.arrays[name].subarray((mode[k] - 1) * n, mode[k] * n));
      this.modes[k] = mode[k];
    });
    this.due(true);
  }

  put(name, values) {
    const attribute = this.sheet.geometry.getAttribute(name);
    attribute.array = values;
    attribute.needsUpdate = true;
  }

  /** Colours: three of families; or values (n,) from low x limit to limit on a ramp [[r, g, b], ...] of bytes. */
  colours({ families, values = null, limit = 1, low = -1, ramp = null, move = 0, byFamily = false }) {
    const u = this.uniforms;
    u.uColours.value = families.map((colour) => new THREE.Vector3(...colour));
    u.uColouring.value = values ? 2 : Number(byFamily);
    u.uMove.value = move;
    if (values) {
      this.put('value', values);
      [u.uLimit.value, u.uLow.value] = [limit, low];
      u.uRamp.value?.dispose();
      const bytes = new Uint8Array(ramp.flatMap((rgb) => [...rgb, 255]));
      u.uRamp.value = new THREE.DataTexture(bytes, ramp.length, 1);
      Object.assign(u.uRamp.value, { magFilter: THREE.LinearFilter, minFilter: THREE.LinearFilter, needsUpdate: true });
    }
    this.due(true);
  }

  /** Colours of the page itself: paper and shadow [r, g, b], how dark, and those of the marks. */
  page({ paper, shadow, dark, marks }) {
    this.renderer.setClearColor(new THREE.Color(...paper), 1);
    this.ground.uniforms.uTint.value.setRGB(...shadow);
    this.ground.uniforms.uDark.value = dark;
    this.marks.paint(marks);
    this.due();
  }

  /** Leave away what lies beyond: axis x, y, z or '', and where from -1 to 1 of the structure's box. */
  section(axis, at) {
    const plane = [0, 0, 0, 1];
    const index = 'xyz'.indexOf(axis || '-');
    if (index >= 0) {
      const V = this.data.arrays.V;
      let reach = 0;
      for (let i = index; i < V.length; i += 3) reach = Math.max(reach, Math.abs(V[i]));
      const away = -(Math.sign(this.data.facts.towards[index]) || 1); // what faces the eye is left away
      plane[index] = away;
      plane[3] = -away * at * reach;
    }
    this.uniforms.uSection.value = plane;
    this.due(true);
  }

  whole(yes) {
    this.uniforms.uWhole.value = Number(yes);
    this.due(true);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.eye.resize(width / height);
  }

  /** A frame is due; `shape` where the shadow changes too. Nothing is drawn otherwise. */
  due(shape = false) {
    if (shape) {
      this.shadowDue = true;
      this.changedAt = performance.now();
    }
    this.asked ??= requestAnimationFrame(() => {
      this.asked = null;
      this.draw();
    });
  }

  draw() {
    if (!this.data) return;
    if (this.shadowDue && performance.now() - (this.changedAt ?? 0) >= CALM) {
      this.shadowDue = false;
      this.ground.update(this.renderer, this.uniforms, this.scene);
    } else if (this.shadowDue) {
      clearTimeout(this.later);
      this.later = setTimeout(() => this.due(), CALM);
    }
    const camera = this.eye.camera;
    this.ground.seenFrom(camera);
    this.uniforms.uUp.value.copy(this.eye.up).transformDirection(camera.matrixWorldInverse);
    this.renderer.clear();
    this.renderer.render(this.scene, camera);
    this.frames += 1;
  }

  /** Where material is seen, one byte for each pixel from the lower left: for tests and for counting. */
  mask() {
    const { width, height } = this.canvas;
    const others = [this.ground.plane, this.marks.group];
    others.forEach((thing) => (thing.visible = false));
    const [soft, cleared] = [this.uniforms.uSoft.value, this.renderer.getClearColor(new THREE.Color())];
    this.uniforms.uSoft.value = 0;
    this.uniforms.uMask.value = 1;
    this.renderer.setClearColor(0xffffff, 1);
    this.renderer.clear();
    this.renderer.render(this.scene, this.eye.camera);
    const bytes = new Uint8Array(4 * width * height);
    this.gl.readPixels(0, 0, width, height, this.gl.RGBA, this.gl.UNSIGNED_BYTE, bytes);
    this.uniforms.uSoft.value = soft;
    this.uniforms.uMask.value = 0;
    this.renderer.setClearColor(cleared, 1);
    others.forEach((thing) => (thing.visible = true));
    this.due();
    const seen = new Uint8Array(width * height);
    for (let i = 0; i < seen.length; i += 1) seen[i] = bytes[4 * i] < 128;
    return { width, height, seen };
  }
}

function uniforms(soft) {
  const start = {
    uFrequency: [1, 1], uPhase: [0, 0], uHalf: [0.5, 0.5], uReach: [-1e30, -1e30], uShown: [1, 1],
    uSection: [0, 0, 0, 1], uUp: new THREE.Vector3(0, 1, 0), uColours: [0, 1, 2].map(() => new THREE.Vector3(1, 1, 1)),
    uRamp: null, uLimit: 1, uLow: -1, uColouring: 0, uMask: 0, uWhole: 0, uSoft: Number(soft), uMove: 0,
  };
  return Object.fromEntries(Object.entries(start).map(([name, value]) => [name, { value }]));
}
