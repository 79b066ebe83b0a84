/** Picking on the surface by spot, region, edge, lasso or brush; the result is a picker for a preset. */

import * as THREE from 'three';

const DIGITS = 5;
const LASSO = 5; // pixels between corners of the lasso
const LEAP = 8; // radii of a brush between two events, at most; a longer step is a jump to another part

export class Picking {
  /** viewer; path: the SVG path of the lasso; done(picker, places): called with the picker and its places (k, 3) in the view. */
  constructor(viewer, path, done) {
    Object.assign(this, { viewer, path, done, usual: done, kind: '', begun: null, ray: new THREE.Raycaster() });
    const canvas = viewer.canvas;
    canvas.addEventListener('pointerdown', (event) => this.down(event), { capture: true });
    canvas.addEventListener('pointermove', (event) => this.move(event));
    canvas.addEventListener('pointerup', (event) => this.up(event));
    canvas.addEventListener('pointercancel', () => this.end());
  }

  /** kind: spot, region, edge, lasso, brush; or '' for none. radius: of a brush, metres. done: callback in place of the usual one. */
  begin(kind, radius = 0, done = this.usual) {
    Object.assign(this, { kind, radius, done });
    document.getElementById('picture').classList.toggle('picking', Boolean(kind));
    this.viewer.eye.free = !['lasso', 'region', 'brush'].includes(kind);
    this.end();
    this.begun?.();
  }

  end() {
    this.track = null;
    this.path.setAttribute('d', '');
  }

  down(event) {
    if (!this.kind || event.button !== 0) return;
    this.track = [[event.offsetX, event.offsetY]];
    if (this.kind === 'region') this.middle = this.hit(event);
    if (this.kind === 'brush') this.stroke = new Stroke(this, this.hit(event));
    if (!this.viewer.eye.enabled) this.viewer.canvas.setPointerCapture(event.pointerId);
  }

  move(event) {
    if (!this.track) return;
    if (this.kind === 'brush') {
      this.stroke.to(this.hit(event));
      return;
    }
    const [x, y] = this.track.at(-1);
    if (Math.hypot(event.offsetX - x, event.offsetY - y) < LASSO) return;
    this.track.push([event.offsetX, event.offsetY]);
    if (this.kind === 'lasso') this.path.setAttribute('d', `M${this.track.join('L')}`);
    if (this.kind === 'region' && this.middle) {
      const here = this.hit(event);
      if (here) this.radius = this.middle.distanceTo(here);
      this.mark(this.within(this.middle, this.radius));
    }
  }

  up(event) {
    const track = this.track;
    this.end();
    if (!this.kind || !track) return;
    if (this.kind === 'brush') {
      const { points } = this.stroke;
      if (points.length) this.done({ pick: 'brush', points: points.map((point) => this.world(point)), radius: this.radius });
      return;
    }
    const moved = track.length > 2;
    if (this.kind === 'lasso') {
      if (moved) this.give(this.inside(track), (list) => ({ pick: 'vertices', indices: list }));
      return;
    }
    if (this.kind === 'region' && this.middle) {
      const center = this.world(this.middle);
      const radius = Number(this.radius.toPrecision(3));
      this.give(this.within(this.middle, radius), () => ({ pick: 'ball', center, radius }));
    }
    if (moved) return; // the picture was turned
    const at = this.hit(event);
    if (!at) return;
    if (this.kind === 'spot') {
      const near = this.nearest(at);
      this.give([near], () => ({ pick: 'nearest', points: [this.world(this.vertex(near))] }));
    }
    if (this.kind === 'edge') this.edge(at);
  }

  /** The whole boundary loop next to a place. */
  edge(at) {
    const { facts, arrays } = this.viewer.data;
    let [best, chosen, start] = [Infinity, null, 0];
    facts.loops.forEach((count, loop) => {
      const list = [...arrays.loops.subarray(start, start + count)];
      for (const i of list) {
        const away = this.vertex(i).distanceTo(at);
        if (away < best) [best, chosen] = [away, { loop, list }];
      }
      start += count;
    });
    if (chosen) this.give(chosen.list, () => ({ pick: 'boundary', loop: chosen.loop }));
  }

  give(list, picker) {
    if (!list.length) return;
    this.mark(list);
    this.done(this.lasting(picker(list), list), this.places(list), list);
  }

  /** If regions cut the mesh, its vertices and edges have other numbers than in the preset: return their places then. */
  lasting(picker, list) {
    const counted = ['vertices', 'boundary'].includes(picker.pick);
    if (!counted || !this.viewer.data.facts.pattern?.region?.length) return picker;
    return { pick: 'nearest', points: list.map((i) => this.world(this.vertex(i))) };
  }

  /** Mark vertices; without vertices remove the marks. */
  mark(list) {
    const few = list.filter((_, i) => i % Math.ceil(list.length / 2000) === 0);
    this.viewer.marks.point(this.places(few), this.viewer.data.facts.size);
    this.viewer.due();
  }

  /** Places (n, 3) flat of the preset's vertices, because the drawn mesh may be divided and cut open. */
  get V() {
    const { V, uncut } = this.viewer.data.arrays;
    return uncut ?? V;
  }

  places(list) {
    return list.flatMap((i) => [...this.V.subarray(3 * i, 3 * i + 3)]);
  }

  vertex(i) {
    return new THREE.Vector3().fromArray(this.V, 3 * i);
  }

  /** Metres in the preset's own axes. */
  world(place) {
    return place.toArray().map((x, i) => Number((x + this.viewer.data.facts.centre[i]).toFixed(DIGITS)));
  }

  hit(event) {
    const { clientWidth: w, clientHeight: h } = this.viewer.canvas;
    const at = new THREE.Vector2((2 * event.offsetX) / w - 1, 1 - (2 * event.offsetY) / h);
    this.ray.setFromCamera(at, this.viewer.eye.camera);
    return this.ray.intersectObject(this.viewer.sheet)[0]?.point ?? null;
  }

  /** Place of a handle that is dragged in the picture: on the surface, or at the vertex next to the line of sight. */
  near(event) {
    const at = this.hit(event);
    if (at) return at;
    let [best, chosen] = [Infinity, null];
    for (let i = 0; i < this.V.length / 3; i += 1) {
      const away = this.ray.ray.distanceSqToPoint(this.vertex(i));
      if (away < best) [best, chosen] = [away, i];
    }
    return chosen === null ? null : this.vertex(chosen);
  }

  nearest(at) {
    const { V } = this;
    let [best, chosen] = [Infinity, 0];
    for (let i = 0; i < V.length / 3; i += 1) {
      const away = Math.hypot(V[3 * i] - at.x, V[3 * i + 1] - at.y, V[3 * i + 2] - at.z);
      if (away < best) [best, chosen] = [away, i];
    }
    return chosen;
  }

  within(at, radius) {
    const { V } = this;
    const list = [];
    for (let i = 0; i < V.length / 3; i += 1) {
      if (Math.hypot(V[3 * i] - at.x, V[3 * i + 1] - at.y, V[3 * i + 2] - at.z) <= radius) list.push(i);
    }
    return list;
  }

  /** Vertices within a polygon of pixels in the picture, also hidden ones. */
  inside(track) {
    const { clientWidth: w, clientHeight: h } = this.viewer.canvas;
    const list = [];
    for (let i = 0; i < this.V.length / 3; i += 1) {
      const p = this.vertex(i).project(this.viewer.eye.camera);
      if (encloses(track, ((p.x + 1) / 2) * w, ((1 - p.y) / 2) * h)) list.push(i);
    }
    return list;
  }
}

/** Places of a brush, at least a third of its radius apart, and its vertices. */
class Stroke {
  constructor(picking, at) {
    Object.assign(this, { picking, points: [], painted: new Set(), left: true });
    this.to(at);
  }

  to(at) {
    const { picking, left } = this;
    const last = this.points.at(-1);
    this.left = !at;
    const way = at && last ? last.distanceTo(at) / picking.radius : 0;
    if (!at || (last && way < 1 / 3)) return;
    const steps = left || way > LEAP ? 1 : Math.ceil(2 * way);
    for (let k = 1; k <= steps; k += 1) this.dot(steps === 1 ? at : last.clone().lerp(at, k / steps));
    picking.mark([...this.painted]);
  }

  dot(at) {
    this.points.push(at);
    for (const i of this.picking.within(at, this.picking.radius)) this.painted.add(i);
  }
}

/** Whether a polygon winds around a place: an odd number of its sides lie to the right. */
function encloses(polygon, x, y) {
  let odd = false;
  polygon.forEach(([x1, y1], i) => {
    const [x0, y0] = polygon.at(i - 1);
    if (y0 > y !== y1 > y && x < ((x0 - x1) * (y - y1)) / (y0 - y1) + x1) odd = !odd;
  });
  return odd;
}
