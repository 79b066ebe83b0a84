/** The shaders: stripes by leaving pixels away, as dsfab/app/shader.py does, with edges one pixel soft. */

export const VERTEX = `
precision highp float;
in vec3 position; in vec3 normal; in float modeU; in float modeW; in vec2 halfWidth; in vec2 kept; in float value; in vec3 moved;
uniform mat4 modelViewMatrix; uniform mat4 projectionMatrix; uniform mat3 normalMatrix; uniform float uMove;
out vec2 vMode; out vec2 vHalf; out vec2 vKept; out float vValue; out vec3 vNormal; out vec3 vEye; out vec3 vPlace;
void main() {
  vMode = vec2(modeU, modeW); vHalf = halfWidth; vKept = kept; vValue = value;
  vNormal = normalMatrix * normal;
  vPlace = position;
  vec4 eye = modelViewMatrix * vec4(position + uMove * moved, 1.0);
  vEye = eye.xyz;
  gl_Position = projectionMatrix * eye;
}`;

/** `wave` is the one line of GLSL that the server hands over. */
export const fragment = (wave) => `
precision highp float;
in vec2 vMode; in vec2 vHalf; in vec2 vKept; in float vValue; in vec3 vNormal; in vec3 vEye; in vec3 vPlace;
uniform vec2 uFrequency; uniform vec2 uPhase; uniform vec2 uHalf; uniform vec2 uReach; uniform vec2 uShown;
uniform vec4 uSection; uniform vec3 uUp; uniform vec3 uColours[3]; uniform sampler2D uRamp;
uniform float uLimit; uniform float uLow; uniform int uColouring; uniform int uMask; uniform int uWhole; uniform int uSoft;
out vec4 colour;
${wave}
vec2 stripes() {  // how many pixels inside a stripe of each family; negative outside
  vec2 d = vec2(uHalf.x < 0.0 ? vHalf.x : uHalf.x, uHalf.y < 0.0 ? vHalf.y : uHalf.y);
  vec2 z = uFrequency * vMode + uPhase;
  vec2 inside = (vec2(wave(z.x), wave(z.y)) - (1.0 - 4.0 * d)) / (4.0 * max(fwidth(z), vec2(1e-9)));
  inside = mix(inside, vec2(1e6), greaterThanEqual(d, vec2(0.5)));  // chosen, not weighed: infinity times 0 is no number
  return mix(vec2(-1e6), inside, greaterThan(uShown, vec2(0.5)));
}
vec3 shaded(vec3 base) {
  vec3 flatNormal = normalize(cross(dFdx(vEye), dFdy(vEye)));
  vec3 n = normalize(vNormal);
  bool back = dot(n, flatNormal) < 0.0;
  if (back) n = -n;
  if (dot(n, flatNormal) < 0.8) n = flatNormal;  // a crease
  float key = max(0.0, 0.35 + 0.65 * dot(n, normalize(vec3(-0.45, 0.65, 0.62))));
  float sky = 0.5 + 0.5 * dot(n, uUp);
  float light = 0.46 + 0.42 * key + 0.20 * sky;
  return base * (back ? 0.80 * light : light);
}
void main() {
  if (dot(vec4(vPlace, 1.0), uSection) < 0.0) discard;
  vec2 s = stripes();
  vec2 k = (uReach - vKept) / max(fwidth(vKept), vec2(1e-9));
  k = mix(k, vec2(-1e6), lessThan(uReach, vec2(0.0)));
  float keep = max(k.x, k.y);
  float inside = uWhole == 1 ? 1e6 : max(max(s.x, s.y), keep);
  float cover = uSoft == 1 ? clamp(inside + 0.5, 0.0, 1.0) : step(1e-12, inside);
  if (cover <= 0.0) discard;
  if (uMask == 1) { colour = vec4(0.0, 0.0, 0.0, 1.0); return; }
  vec3 base = uColours[0];
  if (uColouring == 1) base = keep > 0.0 ? uColours[2] : (s.x > 0.0 ? uColours[0] : uColours[1]);
  if (uColouring == 2) base = texture(uRamp, vec2((vValue / uLimit - uLow) / (1.0 - uLow), 0.5)).rgb;
  float ink = uWhole == 1 ? 0.0 : 0.34 * (1.0 - smoothstep(0.4, 1.7, inside));
  colour = vec4(shaded(base) * (1.0 - ink), cover);
}`;

export const GROUND_VERTEX = `
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

/** A shadow that is as soft as a wide sky makes it: the mean over a disc. */
export const GROUND = `
precision highp float;
in vec2 vAt; in vec2 vOff; uniform sampler2D uShadow; uniform float uDark; uniform vec3 uTint;
out vec4 colour;
void main() {
  float dark = 0.0;
  for (int i = 0; i < 32; i++) {  // points of a sunflower
    float r = sqrt((float(i) + 0.5) / 32.0) * 0.004, a = 2.39996 * float(i);
    vec2 at = vAt + r * vec2(cos(a), sin(a));
    if (all(greaterThan(at, vec2(0.0))) && all(lessThan(at, vec2(1.0)))) dark += 1.0 - texture(uShadow, at).r;
  }
  float fade = 1.0 - smoothstep(0.5, 1.0, length(vOff));
  colour = vec4(uTint, uDark * fade * dark / 32.0);
}`;
