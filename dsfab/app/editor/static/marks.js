/** Arrows for loads and reactions, cones for supports, in the colours of the page. */

import * as THREE from 'three';

const SHARE = { points: 0.13, spread: 0.065, reactions: 0.09 };

/** One group for each layer: loads, supports, reactions. */
export class Marks {
  constructor() {
    this.group = new THREE.Group();
    this.layers = {};
    for (const name of ['loads', 'supports', 'reactions', 'picked']) {
      this.layers[name] = new THREE.Group();
      this.group.add(this.layers[name]);
    }
    this.materials = { loads: plain(), supports: plain(), reactions: plain(), picked: plain() };
  }

  /** colours: by layer, as [r, g, b] from 0 to 1. */
  paint(colours) {
    for (const [name, material] of Object.entries(this.materials)) material.color.setRGB(...colours[name]);
  }

  show(name, yes) {
    this.layers[name].visible = yes;
  }

  /** Replace the marks by those of a model and of picked places. */
  place({ facts, arrays }) {
    const { size, up } = facts;
    for (const layer of Object.values(this.layers)) clear(layer);
    for (const [name, layer] of [['points', 'loads'], ['spread', 'loads'], ['reactions', 'reactions']]) {
      this.layers[layer].add(arrows(arrays[name], SHARE[name] * size, size, this.materials[layer], layer === 'reactions'));
    }
    this.layers.supports.add(cones(arrays.supports, new THREE.Vector3().fromArray(up), size, this.materials.supports));
  }

  /** Show the places under the pointer, (k, 3) flat, as small balls. */
  point(places, size) {
    clear(this.layers.picked);
    const count = places.length / 3;
    if (!count) return;
    const balls = new THREE.InstancedMesh(new THREE.OctahedronGeometry(0.004 * size, 1), this.materials.picked, count);
    const matrix = new THREE.Matrix4();
    for (let i = 0; i < count; i += 1) balls.setMatrixAt(i, matrix.makeTranslation(...places.slice(3 * i, 3 * i + 3)));
    balls.frustumCulled = false;
    this.layers.picked.add(balls);
  }

  /** Show arrows until the server has solved: (k, 6) flat, place and force. */
  pend(list, size) {
    this.layers.loads.add(arrows(new Float32Array(list), SHARE.points * size, size, this.materials.loads, false));
  }

  pendSupports(places, up, size) {
    this.layers.supports.add(cones(places, new THREE.Vector3().fromArray(up), size, this.materials.supports));
  }
}

const plain = () => new THREE.MeshBasicMaterial();

function clear(group) {
  for (const child of group.children) {
    child.dispose?.();
    child.geometry.dispose();
  }
  group.clear();
}

/** Arrows with their tips at their places, also for reactions, which push the structure. */
function arrows(list, longest, size, material) {
  const count = list.length / 6;
  const forces = Array.from({ length: count }, (_, i) => new THREE.Vector3().fromArray(list, 6 * i + 3));
  const most = Math.max(...forces.map((force) => force.length()), 1e-30);
  const made = new THREE.InstancedMesh(arrow(), material, count);
  const [matrix, turn, scale] = [new THREE.Matrix4(), new THREE.Quaternion(), new THREE.Vector3()];
  const along = new THREE.Vector3(0, 1, 0);
  forces.forEach((force, i) => {
    const long = longest * (0.35 + 0.65 * Math.sqrt(force.length() / most));
    turn.setFromUnitVectors(along, force.clone().normalize());
    const wide = Math.min(long, 0.09 * size);
    matrix.compose(new THREE.Vector3().fromArray(list, 6 * i), turn, scale.set(wide, long, wide));
    made.setMatrixAt(i, matrix);
  });
  made.frustumCulled = false;
  return made;
}

/** An arrow of length one along y, its tip at the origin. */
function arrow() {
  const head = new THREE.ConeGeometry(0.075, 0.22, 16).translate(0, -0.11, 0);
  const shaft = new THREE.CylinderGeometry(0.016, 0.016, 0.8, 10).translate(0, -0.6, 0);
  return merged(head, shaft);
}

function cones(places, up, size, material) {
  const high = 0.019 * size;
  const shape = new THREE.ConeGeometry(0.55 * high, high, 16).translate(0, -high / 2, 0);
  const made = new THREE.InstancedMesh(shape, material, places.length / 3);
  const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), up);
  const [matrix, one] = [new THREE.Matrix4(), new THREE.Vector3(1, 1, 1)];
  for (let i = 0; i < places.length / 3; i += 1) {
    made.setMatrixAt(i, matrix.compose(new THREE.Vector3().fromArray(places, 3 * i), turn, one));
  }
  made.frustumCulled = false;
  return made;
}

function merged(one, two) {
  const [a, b] = [one.toNonIndexed().getAttribute('position').array, two.toNonIndexed().getAttribute('position').array];
  const both = new Float32Array(a.length + b.length);
  both.set(a);
  both.set(b, a.length);
  return new THREE.BufferGeometry().setAttribute('position', new THREE.BufferAttribute(both, 3));
}
