/** The shaders: they discard pixels between stripes, as dsfab/render/shader.py does, with antialiased edges.
 *
 * CUT draws the server's cut sheet, and EDGE its outline: a line as dark as the rim of a stripe.
 *
 * #define leaves out the parts that a picture does not need (see sheet.js), because a software renderer
 * pays for every line in every pixel. Light is computed at vertices, except for meshes with creases.
 */

export const VERTEX = `
precision highp float;
in vec3 position; in vec3 normal;
uniform mat4 modelViewMatrix; uniform mat4 projectionMatrix; uniform mat3 normalMatrix; uniform vec3 uUp;
#ifdef CUT
in float tint; out float vTint;
#endif
#if !defined(WHOLE) && !defined(CUT)
in float modeU; in float modeW; uniform vec2 uFrequency; uniform vec2 uPhase; out vec2 vPhase;
#ifdef VARY
in vec2 halfWidth; out vec2 vHalf;
#endif
#ifdef KEEP
in vec2 kept; uniform vec2 uReach; out vec2 vKeep;
#endif
#endif
#ifdef SECTION
uniform vec4 uSection; out float vSection;
#endif
#ifdef VALUE
in float value; uniform float uLimit; uniform float uLow; out float vValue;
#endif
#ifdef MOVE
in vec3 moved; uniform float uMove;
#endif
#ifdef CREASE
out vec3 vNormal; out vec3 vEye;
#else
out vec2 vLight;
#endif
LIGHT
void main() {
#ifdef CUT
  vTint = tint;
#endif
#if !defined(WHOLE) && !defined(CUT)
  vPhase = uFrequency * vec2(modeU, modeW) + uPhase;
#ifdef VARY
  vHalf = halfWidth;
#endif
#ifdef KEEP
  vKeep = mix(uReach - kept, vec2(-1e6), lessThan(uReach, vec2(0.0)));
#endif
#endif
#ifdef SECTION
  vSection = dot(vec4(position, 1.0), uSection);
#endif
#ifdef VALUE
  vValue = (value / uLimit - uLow) / (1.0 - uLow);
#endif
  vec3 place = position;
#ifdef MOVE
  place += uMove * moved;
#endif
  vec4 eye = modelViewMatrix * vec4(place, 1.0);
#ifdef CREASE
  vNormal = normalMatrix * normal; vEye = eye.xyz;
#else
  vec3 n = normalize(normalMatrix * normal);
  vLight = vec2(light(n), 0.80 * light(-n));
#ifdef EDGE
  vLight = dot(n, eye.xyz) < 0.0 ? vLight.xx : vLight.yy;  // a line has no back
#endif
#endif
  gl_Position = projectionMatrix * eye;
}`.replace('LIGHT', light());

/** Light on a normal towards the eye: a lamp over the left shoulder, and a sky. */
function light() {
  return `
float light(vec3 n) {
  float key = max(0.0, 0.35 + 0.65 * dot(n, normalize(vec3(-0.45, 0.65, 0.62))));
  return 0.46 + 0.42 * key + 0.20 * (0.5 + 0.5 * dot(n, uUp));
}`;
}

/** `wave` is the one line of GLSL that the server hands over. */
export const fragment = (wave) => `
precision highp float;
out vec4 colour;
uniform vec3 uColours[3];
#ifdef CUT
in float vTint;
#endif
#if !defined(WHOLE) && !defined(CUT)
in vec2 vPhase;
#ifdef VARY
in vec2 vHalf;
#else
uniform vec2 uHalf;
#endif
#ifdef KEEP
in vec2 vKeep;
#endif
${wave}
vec2 stripes() {  // how many pixels inside a stripe of each family; negative outside
#ifdef VARY
  vec2 d = vHalf;
#else
  vec2 d = uHalf;
#endif
  vec2 inside = vec2(wave(vPhase.x), wave(vPhase.y)) - 1.0 + 4.0 * d;
#ifdef SOFT
  inside /= 4.0 * max(fwidth(vPhase), vec2(1e-9));
#endif
  return mix(inside, vec2(1e6), greaterThanEqual(d, vec2(0.5)));  // chosen, not weighed: infinity times 0 is no number
}
#endif
#ifdef SECTION
in float vSection;
#endif
#ifdef VALUE
in float vValue; uniform sampler2D uRamp;
#endif
#ifdef CREASE
in vec3 vNormal; in vec3 vEye; uniform vec3 uUp;
${light()}
float shade() {
  vec3 flatNormal = normalize(cross(dFdx(vEye), dFdy(vEye)));
  vec3 n = normalize(vNormal);
  bool back = dot(n, flatNormal) < 0.0;
  if (back) n = -n;
  if (dot(n, flatNormal) < 0.8) n = flatNormal;
  return back ? 0.80 * light(n) : light(n);
}
#else
in vec2 vLight;
float shade() { return gl_FrontFacing ? vLight.x : vLight.y; }
#endif
void main() {
#ifdef SECTION
  if (vSection < 0.0) discard;
#endif
  float cover = 1.0, ink = 0.0;
#if !defined(WHOLE) && !defined(CUT)
  vec2 s = stripes();
  float inside = max(s.x, s.y);
#ifdef KEEP
#ifdef SOFT
  vec2 keeps = vKeep / max(fwidth(vKeep), vec2(1e-9));  // each by its own: they may differ by thirty powers of ten
  float keep = max(keeps.x, keeps.y);
#else
  float keep = max(vKeep.x, vKeep.y);
#endif
  inside = max(inside, keep);
#endif
#ifdef SOFT
  cover = min(inside + 0.5, 1.0);
  if (cover <= 0.0) discard;
  ink = 0.34 * (1.0 - smoothstep(0.4, 1.7, inside));
#else
  if (inside <= 1e-12) discard;
#endif
#endif
#ifdef MASK
  colour = vec4(0.0, 0.0, 0.0, 1.0);
#else
  vec3 base = uColours[0];
#ifdef EDGE
  ink = 0.34;
#endif
#if defined(FAMILY) && defined(CUT)
  base = uColours[int(vTint + 0.5)];
#elif defined(FAMILY) && !defined(WHOLE)
  if (s.x <= 0.0) base = uColours[1];
#ifdef KEEP
  if (keep > 0.0) base = uColours[2];
#endif
#endif
#ifdef VALUE
  base = texture(uRamp, vec2(vValue, 0.5)).rgb;
#endif
  colour = vec4(base * (shade() * (1.0 - ink)), cover);
#endif
}`;
