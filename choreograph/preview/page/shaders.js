// The three things that are drawn: the body, its shadow from above, the floor.

const SKINNED = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D uSkin; // a row a joint: the three rows of its matrix
in vec3 aPlace;
in vec3 aNormal;
in vec3 aColour;
in uvec2 aJoints;
in float aWeight;
void skinned(out vec3 place, out vec3 normal) {
  vec4 rows[3];
  for (int k = 0; k < 3; k++)
    rows[k] = mix(texelFetch(uSkin, ivec2(k, aJoints.y), 0), texelFetch(uSkin, ivec2(k, aJoints.x), 0), aWeight);
  vec4 p = vec4(aPlace, 1.0);
  place = vec3(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p));
  normal = vec3(dot(rows[0].xyz, aNormal), dot(rows[1].xyz, aNormal), dot(rows[2].xyz, aNormal));
}
`;

export const BODY_VERTEX = `${SKINNED}
uniform mat4 uMatrix;
out vec3 vPlace;
out vec3 vNormal;
out vec3 vColour;
void main() {
  skinned(vPlace, vNormal);
  vColour = aColour * aColour; // to light, near enough to the power 2.2
  gl_Position = uMatrix * vec4(vPlace, 1.0);
}`;

// Hemisphere and key light, a soft highlight, and a rim that lifts the body off the stage.
export const BODY_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 uEye;
uniform vec3 uLight;
uniform vec3 uRim;
uniform vec3 uGround;
uniform float uExposure;
in vec3 vPlace;
in vec3 vNormal;
in vec3 vColour;
out vec4 colour;
void main() {
  vec3 n = normalize(vNormal);
  vec3 v = normalize(uEye - vPlace);
  float up = 0.5 + 0.5 * n.y;
  float key = max(0.0, (dot(n, uLight) + 0.22) / 1.22);
  float grazing = 1.0 - max(0.0, dot(n, v));
  float shine = pow(max(0.0, dot(n, normalize(uLight + v))), 28.0);
  float near = smoothstep(-0.02, 0.28, vPlace.y); // less light reaches what is close to the floor
  vec3 fill = mix(uGround, vec3(0.40, 0.44, 0.52), up) * (0.55 + 0.45 * near);
  vec3 lit = vColour * (fill + key * key * vec3(1.30, 1.22, 1.10)) + 0.10 * shine * key;
  lit += uRim * (grazing * grazing * grazing * (0.35 + 0.65 * up));
  colour = vec4(sqrt(clamp(lit * uExposure, 0.0, 1.0)), 1.0);
}`;

// From above, slid along the light: red is what touches the floor, green what is over it.
export const SHADOW_VERTEX = `${SKINNED}
uniform vec3 uCentre; // x, z and half the width
uniform vec2 uSlide;
out float vHeight;
void main() {
  vec3 place, normal;
  skinned(place, normal);
  vHeight = place.y;
  vec2 ground = (place.xz - uSlide * place.y - uCentre.xy) / uCentre.z;
  gl_Position = vec4(ground, 0.0, 1.0);
}`;

export const SHADOW_FRAGMENT = `#version 300 es
precision highp float;
in float vHeight;
out vec4 colour;
void main() {
  float h = max(vHeight, 0.0);
  colour = vec4(exp(-h * h * 160.0), exp(-h * 1.25), 0.0, 1.0);
}`;

export const BLUR_VERTEX = `#version 300 es
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  gl_Position = vec4(corner * 4.0 - 1.0, 0.0, 1.0);
}`;

// One direction of a blur, narrow for the contact and wide for the shadow.
export const BLUR_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D uSource;
uniform vec2 uStep;
out vec4 colour;
void main() {
  vec2 at = gl_FragCoord.xy / vec2(textureSize(uSource, 0));
  vec2 sum = vec2(0.0), weights = vec2(0.0);
  for (int i = -5; i <= 5; i++) {
    float d = float(i);
    vec2 w = exp(-d * d * vec2(0.42, 0.075));
    sum += w * texture(uSource, at + d * uStep).rg;
    weights += w;
  }
  colour = vec4(sum / weights, 0.0, 1.0);
}`;

export const FLOOR_VERTEX = `#version 300 es
uniform mat4 uMatrix;
uniform vec3 uDisc; // x, z and radius
in vec2 aCorner;
out vec2 vGround;
out float vEdge;
void main() {
  vGround = uDisc.xy + uDisc.z * aCorner;
  vEdge = length(aCorner);
  gl_Position = uMatrix * vec4(vGround.x, 0.0, vGround.y, 1.0);
}`;

export const FLOOR_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D uShadow;
uniform vec3 uCentre;
uniform vec3 uStage;
uniform vec3 uFloor;
uniform vec3 uLine;
uniform vec3 uShade;
in vec2 vGround;
in float vEdge;
out vec4 colour;
void main() {
  vec2 width = fwidth(vGround);
  vec2 off = abs(fract(vGround + 0.5) - 0.5);
  vec2 lines = 1.0 - smoothstep(0.004 + width * 0.5, 0.008 + width * 1.4, off);
  float fine = clamp(1.2 - 9.0 * max(width.x, width.y), 0.0, 1.0);
  float fade = 1.0 - vEdge;
  fade = fade * fade * (3.0 - 2.0 * fade);
  vec3 ground = mix(uFloor, uLine, max(lines.x, lines.y) * fine);
  vec2 at = (vGround - uCentre.xy) / uCentre.z;
  vec2 dark = texture(uShadow, at * 0.5 + 0.5).rg;
  float inside = 1.0 - smoothstep(0.85, 1.0, max(abs(at.x), abs(at.y)));
  float shade = 1.0 - (1.0 - 0.62 * dark.r) * (1.0 - 0.60 * dark.g);
  colour = vec4(mix(uStage, mix(ground, uShade, shade * inside), fade), 1.0);
}`;
