/** Draws a structure, independent of sliders, server and presets. */

import * as THREE from 'three';
import { Eye } from './camera.js';
import { Ground } from './ground.js';
import { Marks } from './marks.js';
import { Sheet } from './sheet.js';

THREE.ColorManagement.enabled = false; // so that colours appear as given

const CALM = 140; // milliseconds from the last change to a new shadow

export class Viewer {
  /** canvas; wave: line of GLSL from the server. Throws without WebGL2. */
  constructor(canvas, wave, { antialias = true } = {}) {
    const context = canvas.getContext('webgl2', { alpha: false, antialias });
    if (!context) throw new Error('this browser has no WebGL2');
    this.gl = context;
    this.renderer = new THREE.WebGLRenderer({ canvas, context });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.renderer.autoClear = false;
    this.canvas = canvas;
    this.scene = new THREE.Scene();
    this.sheet = new Sheet(wave, antialias);
    this.ground = new Ground(this.sheet);
    this.marks = new Marks();
    this.scene.add(this.ground.plane, this.sheet, this.marks.group);
    this.eye = new Eye(canvas, () => this.due());
    this.frames = 0;
    this.drawn = null; // called after each frame
    canvas.addEventListener('webglcontextrestored', () => this.due());
  }

  /** Show another structure, see `draft_model` in drafts.py. */
  model(model) {
    const { facts, arrays } = model;
    this.data = model;
    this.sheet.shape(model);
    this.marks.place(model);
    this.ground.place(model);
    this.shadowDue = true;
    const first = !this.title || this.title !== facts.opening;
    this.title = facts.opening;
    this.eye.size === undefined || first ? this.eye.look(model) : Object.assign(this.eye, { points: arrays.V, size: facts.size });
    return first;
  }

  /** See sheet.js. */
  stripes(pattern) {
    this.sheet.stripes(pattern);
    this.due(true);
  }

  /** Draw the server's cut sheet until the next change. */
  settle(cut) {
    this.sheet.settle(cut);
    this.due(true);
  }

  colours(how) {
    this.sheet.colours(how);
    this.due(true);
  }

  /** Set colours: paper and shadow [r, g, b], darkness of the shadow, and marks. */
  page({ paper, shadow, dark, marks }) {
    this.renderer.setClearColor(new THREE.Color(...paper), 1);
    this.ground.uniforms.uTint.value.setRGB(...shadow);
    this.ground.uniforms.uDark.value = dark;
    this.marks.paint(marks);
    this.due();
  }

  /** Cut by a plane: axis x, y, z or '', and its place from -1 to 1 in the structure's box. */
  section(axis, at) {
    let plane = null;
    const index = 'xyz'.indexOf(axis || '-');
    if (index >= 0) {
      const V = this.data.arrays.V;
      let reach = 0;
      for (let i = index; i < V.length; i += 3) reach = Math.max(reach, Math.abs(V[i]));
      const away = -(Math.sign(this.data.facts.towards[index]) || 1); // hides the side towards the eye
      plane = [0, 0, 0, -away * at * reach];
      plane[index] = away;
    }
    this.sheet.section(plane);
    this.due(true);
  }

  whole(yes) {
    this.sheet.want({ WHOLE: yes });
    this.due(true);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.eye.resize(width / height);
  }

  /** Request a frame; `shape`: the shadow changes too. */
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
      this.ground.update(this.renderer, this.scene);
    } else if (this.shadowDue) {
      clearTimeout(this.later);
      this.later = setTimeout(() => this.due(), CALM);
    }
    const camera = this.eye.camera;
    this.ground.seenFrom(camera);
    this.sheet.uniforms.uUp.value.copy(this.eye.up).transformDirection(camera.matrixWorldInverse);
    this.renderer.clear();
    this.renderer.render(this.scene, camera);
    this.drawn?.();
    this.frames += 1;
  }

  /** The current picture as a JPEG data: address, at most this many pixels wide. */
  snapshot(widest = 960) {
    this.draw(); // the canvas does not keep the last frame
    const scale = Math.min(widest / this.canvas.width, 1);
    const copy = document.createElement('canvas');
    Object.assign(copy, { width: Math.round(scale * this.canvas.width), height: Math.round(scale * this.canvas.height) });
    copy.getContext('2d').drawImage(this.canvas, 0, 0, copy.width, copy.height);
    return copy.toDataURL('image/jpeg', 0.88);
  }

  /** Visible material, one byte for each pixel from the lower left; for tests and counting.
   *
   * live: of stripes as the page draws them, also where what is cut of them is shown.
   */
  mask(live = true) {
    const { width, height } = this.canvas;
    const others = [this.ground.plane, this.marks.group];
    others.forEach((thing) => (thing.visible = false));
    const cleared = this.renderer.getClearColor(new THREE.Color());
    this.renderer.setClearColor(0xffffff, 1);
    this.renderer.clear();
    this.sheet.masked(() => this.renderer.render(this.scene, this.eye.camera), live);
    const bytes = new Uint8Array(4 * width * height);
    this.gl.readPixels(0, 0, width, height, this.gl.RGBA, this.gl.UNSIGNED_BYTE, bytes);
    this.renderer.setClearColor(cleared, 1);
    others.forEach((thing) => (thing.visible = true));
    this.due();
    const seen = new Uint8Array(width * height);
    for (let i = 0; i < seen.length; i += 1) seen[i] = bytes[4 * i] < 128;
    return { width, height, seen };
  }
}
