/** Perspective and parallel cameras, named views, and their control by mouse, touch and keys. */

import * as THREE from 'three';
import { OrbitControls } from './vendor/OrbitControls.js';

export class Eye {
  /** changed(): called when the picture must be drawn again. */
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;
    this.perspective = new THREE.PerspectiveCamera(24, 1, 0.01, 100);
    this.parallel = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.01, 100);
    this.camera = this.perspective;
    this.aspect = 1;
    this.up = new THREE.Vector3(0, 0, 1);
    this.named = {};
    this.steer();
  }

  steer() {
    const target = this.controls?.target.clone();
    this.controls?.dispose();
    const controls = new OrbitControls(this.camera, this.canvas);
    controls.enableDamping = false;
    controls.zoomToCursor = true;
    controls.screenSpacePanning = true;
    // the left button and, as in Rhino, the right one turn; with Shift, or the middle one, they move
    controls.mouseButtons = { LEFT: THREE.MOUSE.ROTATE, MIDDLE: THREE.MOUSE.PAN, RIGHT: THREE.MOUSE.ROTATE };
    controls.touches = { ONE: THREE.TOUCH.ROTATE, TWO: THREE.TOUCH.DOLLY_PAN };
    if (target) controls.target.copy(target);
    controls.addEventListener('change', () => this.changed());
    controls.addEventListener('start', () => (this.fitted = false));
    controls.enabled = this.enabled ?? true;
    this.controls = controls;
  }

  /** Switch turning by dragging on or off. */
  set free(yes) {
    this.enabled = yes;
    this.controls.enabled = yes;
  }

  /** Show another structure: points (n, 3) flat, its size, its upward direction, and its best view. */
  look({ facts, arrays }) {
    this.points = arrays.V;
    this.size = facts.size;
    this.up.fromArray(facts.up);
    this.perspective.fov = facts.angle;
    const iso = new THREE.Vector3().fromArray(facts.towards);
    // the front is the side of the three-quarter view that an axis of the model points to
    const level = iso.clone().addScaledVector(this.up, -iso.dot(this.up));
    const axes = [0, 1, 2].map((i) => new THREE.Vector3().setComponent(i, Math.sign(level.getComponent(i)) || 1));
    const front = axes.filter((axis) => Math.abs(axis.dot(this.up)) < 0.5).sort((a, b) => b.dot(level) - a.dot(level))[0];
    const side = new THREE.Vector3().crossVectors(this.up, front);
    this.named = { iso, top: this.up.clone().addScaledVector(front, 1e-3).normalize(), front, side };
    for (const camera of [this.perspective, this.parallel]) camera.up.copy(this.up);
    this.steer();
  }

  /** Show all from a named side: iso, top, front or side. */
  view(name) {
    this.controls.target.set(0, 0, 0);
    this.camera.position.copy(this.named[name]).multiplyScalar(4 * this.size);
    this.fit();
  }

  /** Move along the line of sight until everything fits. */
  fit() {
    const camera = this.camera;
    const towards = camera.position.clone().sub(this.controls.target).normalize();
    const matrix = new THREE.Matrix4().lookAt(towards, new THREE.Vector3(), this.up);
    const [right, up] = [new THREE.Vector3(), new THREE.Vector3()];
    matrix.extractBasis(right, up, new THREE.Vector3());
    const slope = Math.tan((this.perspective.fov / 2) * (Math.PI / 180));
    const place = new THREE.Vector3();
    const room = 1.26;
    let centre = new THREE.Vector3();
    let far = 4 * this.size;
    const stride = 3 * Math.max(1, Math.floor(this.points.length / 30000));
    for (let round = 0; round < 4; round += 1) {
      let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
      for (let i = 0; i < this.points.length; i += stride) {
        place.fromArray(this.points, i).sub(centre);
        const depth = camera.isPerspectiveCamera ? (far - place.dot(towards)) * slope : far * slope;
        const [x, y] = [place.dot(right) / depth / this.aspect, place.dot(up) / depth];
        [x0, x1, y0, y1] = [Math.min(x0, x), Math.max(x1, x), Math.min(y0, y), Math.max(y1, y)];
      }
      centre = centre.addScaledVector(right, ((x0 + x1) / 2) * far * slope * this.aspect).addScaledVector(up, ((y0 + y1) / 2) * far * slope);
      far *= room * Math.max((x1 - x0) / 2, (y1 - y0) / 2);
    }
    this.controls.target.copy(centre);
    camera.position.copy(centre).addScaledVector(towards, far);
    camera.zoom = 1;
    this.half = far * slope;
    this.fitted = true;
    this.settle();
  }

  /** Turn or zoom by a key; return whether the key has a meaning. */
  keyed(key) {
    const { position } = this.camera;
    const off = position.clone().sub(this.controls.target);
    const right = new THREE.Vector3().crossVectors(this.up, off).normalize();
    const step = Math.PI / 24;
    if (key === 'arrowleft' || key === 'arrowright') off.applyAxisAngle(this.up, key === 'arrowleft' ? -step : step);
    else if (key === 'arrowup' || key === 'arrowdown') {
      const turned = off.clone().applyAxisAngle(right, key === 'arrowup' ? -step : step);
      if (turned.clone().cross(this.up).dot(off.clone().cross(this.up)) > 0) off.copy(turned);
    } else if ('+=-'.includes(key)) {
      if (this.camera.isPerspectiveCamera) off.multiplyScalar(key === '-' ? 1.15 : 1 / 1.15);
      else this.camera.zoom *= key === '-' ? 1 / 1.15 : 1.15;
    } else return false;
    position.copy(this.controls.target).add(off);
    this.fitted = false;
    this.settle();
    return true;
  }

  /** The picture's width over its height. */
  resize(aspect) {
    this.aspect = aspect;
    if (this.fitted) this.fit();
    else this.settle();
  }

  settle() {
    const far = this.camera.position.distanceTo(this.controls.target) || 1;
    const reach = far + 3 * (this.size ?? 1);
    Object.assign(this.perspective, { aspect: this.aspect, near: reach / 2000, far: reach });
    const half = this.half ?? 1;
    const box = { left: -half * this.aspect, right: half * this.aspect, top: half, bottom: -half };
    Object.assign(this.parallel, box, { near: -reach, far: reach });
    this.perspective.updateProjectionMatrix();
    this.parallel.updateProjectionMatrix();
    this.controls.update();
    this.changed();
  }

  /** Switch between parallel and perspective, from the same side. */
  project(parallel) {
    const next = parallel ? this.parallel : this.perspective;
    if (next === this.camera) return;
    const old = this.camera;
    const slope = Math.tan((this.perspective.fov / 2) * (Math.PI / 180));
    const away = old.position.clone().sub(this.controls.target);
    if (parallel) this.half = away.length() * slope;
    else away.setLength(this.half / this.parallel.zoom / slope);
    next.position.copy(this.controls.target).add(away);
    next.zoom = 1;
    this.camera = next;
    this.steer();
    this.settle();
  }

  /** The camera as a few numbers, to save and restore it. */
  get numbers() {
    const short = (v) => Number(v.toPrecision(5));
    const { position, zoom } = this.camera;
    const parallel = this.camera === this.parallel;
    return [...position.toArray(), ...this.controls.target.toArray(), zoom, parallel ? this.half : 0].map(short);
  }

  set numbers(list) {
    if (!Array.isArray(list) || list.length !== 8 || !list.every(Number.isFinite)) return;
    this.project(list[7] > 0);
    this.half = list[7] || this.half;
    this.camera.position.fromArray(list);
    this.controls.target.fromArray(list, 3);
    this.camera.zoom = list[6];
    this.fitted = false;
    this.settle();
  }
}
