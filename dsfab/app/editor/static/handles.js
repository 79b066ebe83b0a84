/** Handles at places of the preset, over the picture; the user drags them along the surface, or moves them by arrow keys. */

import * as THREE from 'three';
import { make } from './controls.js';
import { handles, regions } from './regions.js';

const STEP = 8; // pixels of an arrow key
const AWAY = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, -STEP], ArrowDown: [0, STEP] };

export class Handles {
  /** box: their parent, over the canvas; wanted(key): whether to show those of a region. */
  constructor(box, state, viewer, picking, wanted) {
    Object.assign(this, { box, state, viewer, picking, wanted, shown: new Map() });
    viewer.drawn = () => this.follow();
  }

  /** Show the handles of the current preset; a handle in a drag remains the same element. */
  refresh() {
    const list = regions(this.state.preset).filter(({ key }) => this.wanted(key)).flatMap(handles);
    const old = this.shown;
    this.shown = new Map(list.map((handle) => [handle.id, { handle, element: old.get(handle.id)?.element ?? this.element(handle.id) }]));
    for (const [id, { element }] of old) if (!this.shown.has(id)) element.remove();
    for (const { handle, element } of this.shown.values()) {
      element.title = handle.name;
      element.setAttribute('aria-label', `${handle.name}; drag it, or use the arrow keys`);
      element.classList.toggle('radius', Boolean(handle.radius));
    }
    this.follow();
  }

  element(id) {
    const element = make('button', { className: 'handle', type: 'button' });
    element.dataset.handle = id;
    element.addEventListener('pointerdown', (event) => {
      element.setPointerCapture(event.pointerId);
      this.dragged = id;
    });
    element.addEventListener('pointermove', (event) => this.dragged === id && this.to(id, [event.clientX, event.clientY], false));
    for (const end of ['pointerup', 'pointercancel']) element.addEventListener(end, () => this.end(id));
    element.addEventListener('keydown', (event) => {
      const away = AWAY[event.key];
      if (!away) return;
      event.preventDefault();
      const { left, top, width, height } = element.getBoundingClientRect();
      this.to(id, [left + width / 2 + away[0], top + height / 2 + away[1]], true);
    });
    element.addEventListener('blur', () => this.picking.mark([]));
    this.box.append(element);
    return element;
  }

  /** Move a handle to the surface under a place in the window. */
  to(id, [x, y], final) {
    const { left, top } = this.viewer.canvas.getBoundingClientRect();
    const at = this.picking.near({ offsetX: x - left, offsetY: y - top });
    if (!at) return;
    const { handle } = this.shown.get(id);
    this.state.set(handle.moved(this.picking.world(at)), final);
    this.mark(id);
  }

  end(id) {
    if (this.dragged !== id) return;
    this.dragged = null;
    this.state.settle();
    this.state.tell([id], true);
    this.picking.mark([]);
  }

  /** Mark the vertices in a ball while its handle moves. */
  mark(id) {
    const key = id.slice(0, id.lastIndexOf('.'));
    const at = key.split('.').reduce((where, part) => where?.[part], this.state.preset);
    if (at?.pick === 'ball') this.picking.mark(this.picking.within(this.local(at.center), at.radius));
  }

  /** A place of the preset in the view's own metres. */
  local(place) {
    const { centre } = this.viewer.data.facts;
    return new THREE.Vector3(...place.map((x, i) => x - centre[i]));
  }

  /** Move every handle to its place in the current picture. */
  follow() {
    if (!this.viewer.data || !this.shown.size) return;
    const { camera } = this.viewer.eye;
    const { clientWidth: w, clientHeight: h } = this.viewer.canvas;
    const right = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
    for (const { handle, element } of this.shown.values()) {
      const place = this.local(handle.place).addScaledVector(right, handle.radius ?? 0).project(camera);
      element.style.transform = `translate(${((place.x + 1) / 2) * w}px, ${((1 - place.y) / 2) * h}px)`;
      element.hidden = Math.abs(place.x) > 1 || Math.abs(place.y) > 1 || place.z > 1;
    }
  }
}
