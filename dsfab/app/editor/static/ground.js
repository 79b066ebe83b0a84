/** The ground and the soft shadow on it: a picture of the stripes from above, blurred. */

import * as THREE from 'three';

const SIDE = 1024;

export class Ground {
  constructor(sheet) {
    this.sheet = sheet;
    this.sharp = new THREE.WebGLRenderTarget(SIDE, SIDE, { depthBuffer: false });
    this.target = new THREE.WebGLRenderTarget(SIDE, SIDE, { depthBuffer: false });
    this.blur = blurring(this.sharp.texture);
    this.lamp = new THREE.OrthographicCamera();
    this.alone = new THREE.Scene();
    this.uniforms = {
      uLight: { value: new THREE.Matrix4() }, uShadow: { value: this.target.texture },
      uDark: { value: 0.5 }, uTint: { value: new THREE.Color(0, 0, 0) },
    };
    const material = new THREE.RawShaderMaterial({
      uniforms: this.uniforms, vertexShader: GROUND_VERTEX, fragmentShader: GROUND,
      glslVersion: THREE.GLSL3, transparent: true, depthWrite: false, side: THREE.DoubleSide,
    });
    this.plane = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), material);
    this.plane.frustumCulled = false;
    this.plane.renderOrder = -1;
  }

  /** Take another structure; the ground is level with its lowest point. */
  place({ facts, arrays }) {
    const up = new THREE.Vector3().fromArray(facts.up);
    const towards = new THREE.Vector3().fromArray(facts.towards);
    const right = new THREE.Vector3().crossVectors(up, towards).normalize();
    const axis = facts.up.findIndex((x) => Math.abs(x) > 0.5);
    let low = Infinity;
    for (let i = axis; i < arrays.V.length; i += 3) low = Math.min(low, facts.up[axis] * arrays.V[i]);
    this.low = low;
    this.up = up;
    this.plane.position.copy(up).multiplyScalar(low - 0.004 * facts.size);
    this.plane.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), up);
    this.plane.scale.setScalar(0.95 * facts.size);
    const half = 0.8 * facts.size;
    Object.assign(this.lamp, { left: -half, right: half, top: half, bottom: -half, near: 0, far: 6 * facts.size });
    const from = up.clone().addScaledVector(right, -0.5).addScaledVector(towards, 0.35).normalize();
    this.lamp.position.copy(from).multiplyScalar(3 * facts.size);
    this.lamp.up.copy(right);
    this.lamp.lookAt(0, 0, 0);
    this.lamp.updateProjectionMatrix();
    this.lamp.updateMatrixWorld();
    this.uniforms.uLight.value.multiplyMatrices(this.lamp.projectionMatrix, this.lamp.matrixWorldInverse);
  }

  /** Draw the shadow again; afterwards the sheet is back in the scene. */
  update(renderer, parent) {
    this.alone.add(this.sheet);
    const was = renderer.getClearColor(new THREE.Color());
    renderer.setClearColor(0xffffff, 1);
    renderer.setRenderTarget(this.sharp);
    renderer.clear();
    this.sheet.masked(() => renderer.render(this.alone, this.lamp));
    renderer.setRenderTarget(this.target); // blurred once, not in every frame
    renderer.render(this.blur, this.lamp);
    renderer.setRenderTarget(null);
    renderer.setClearColor(was, 1);
    parent.add(this.sheet);
  }

  /** Hide the ground for a view from below. */
  seenFrom(camera) {
    this.plane.visible = camera.position.dot(this.up ?? camera.up) > (this.low ?? 0);
  }
}

/** A scene that fills a picture with the soft shadow. */
function blurring(texture) {
  const material = new THREE.RawShaderMaterial({
    uniforms: { uSharp: { value: texture } }, vertexShader: FULL_VERTEX, fragmentShader: BLUR,
    glslVersion: THREE.GLSL3, depthTest: false, depthWrite: false,
  });
  const full = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), material);
  full.frustumCulled = false;
  return new THREE.Scene().add(full);
}

/** A rectangle that fills the picture. */
const FULL_VERTEX = `
precision highp float;
in vec3 position;
out vec2 vAt;
void main() { vAt = position.xy * 0.5 + 0.5; gl_Position = vec4(position.xy, 0.0, 1.0); }`;

/** Blur as of a wide sky: the mean over a disc. */
const BLUR = `
precision highp float;
in vec2 vAt; uniform sampler2D uSharp;
out vec4 colour;
void main() {
  float light = 0.0;
  for (int i = 0; i < 32; i++) {  // points of a sunflower
    float r = sqrt((float(i) + 0.5) / 32.0) * 0.004, a = 2.39996 * float(i);
    light += texture(uSharp, vAt + r * vec2(cos(a), sin(a))).r;
  }
  colour = vec4(vec3(light / 32.0), 1.0);
}`;

const GROUND_VERTEX = `
precision highp float;
in vec3 position;
uniform mat4 modelMatrix; uniform mat4 viewMatrix; uniform mat4 projectionMatrix; uniform mat4 uLight;
out vec2 vAt; out vec2 vOff;
void main() {
  vec4 place = modelMatrix * vec4(position, 1.0);
  vec4 at = uLight * place;
  vAt = at.xy * 0.5 + 0.5; vOff = position.xy;
  gl_Position = projectionMatrix * viewMatrix * place;
}`;

const GROUND = `
precision highp float;
in vec2 vAt; in vec2 vOff; uniform sampler2D uShadow; uniform float uDark; uniform vec3 uTint;
out vec4 colour;
void main() {
  float fade = 1.0 - smoothstep(0.5, 1.0, length(vOff));
  float dark = 1.0 - texture(uShadow, vAt).r;
  if (fade * dark <= 0.0) discard;
  colour = vec4(uTint, uDark * fade * dark);
}`;
