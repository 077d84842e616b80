// Shaders of the body, its shadow and the floor.

// Hemisphere and key light, a soft highlight, and a rim light that separates the body from the stage.
const LIGHTING = `
uniform vec3 uEye;
uniform vec3 uLight;
uniform vec3 uRim;
uniform vec3 uGround;
uniform float uExposure;
vec3 lit(vec3 place, vec3 normal, vec3 colour) {
  vec3 n = normalize(normal);
  vec3 v = normalize(uEye - place);
  float up = 0.5 + 0.5 * n.y;
  float key = max(0.0, (dot(n, uLight) + 0.22) / 1.22);
  float grazing = 1.0 - max(0.0, dot(n, v));
  float shine = max(0.0, dot(n, normalize(uLight + v)));
  for (int i = 0; i < 5; i++) shine *= shine;
  float near = smoothstep(-0.02, 0.28, place.y); // less light reaches parts close to the floor
  vec3 fill = mix(uGround, vec3(0.40, 0.44, 0.52), up) * (0.55 + 0.45 * near);
  // Conversion to linear light and back, approximating a gamma of 2.2.
  vec3 sum = colour * colour * (fill + key * key * vec3(1.30, 1.22, 1.10)) + 0.10 * shine * key;
  grazing *= grazing;
  sum += uRim * (grazing * grazing * (0.35 + 0.65 * up));
  return sqrt(clamp(sum * uExposure, 0.0, 1.0));
}
`;

// The body shaded per pixel, or, in software rendering, per vertex.
export function bodyShaders(atPixels) {
  const vertex = `#version 300 es
precision highp float;
uniform mat4 uMatrix;
in vec3 aPlace;
in vec3 aNormal;
in vec3 aColour;
out vec3 vColour;
${atPixels ? "out vec3 vPlace;\nout vec3 vNormal;" : LIGHTING}
void main() {
  ${atPixels ? "vPlace = aPlace; vNormal = aNormal; vColour = aColour;" : "vColour = lit(aPlace, aNormal, aColour);"}
  gl_Position = uMatrix * vec4(aPlace, 1.0);
}`;
  const fragment = `#version 300 es
precision highp float;
in vec3 vColour;
out vec4 colour;
${atPixels ? `in vec3 vPlace;\nin vec3 vNormal;${LIGHTING}` : ""}
void main() {
  colour = vec4(${atPixels ? "lit(vPlace, vNormal, vColour)" : "vColour"}, 1.0);
}`;
  return [vertex, fragment];
}

// The shadow: one point per vertex, projected along the light and then blurred. Red is for parts that touch the
// floor, green for parts above it.
export const SHADOW_VERTEX = `#version 300 es
uniform vec3 uCentre; // x, z and half the width
uniform vec2 uSlide;
in vec3 aPlace;
out float vHeight;
void main() {
  vHeight = aPlace.y;
  vec2 ground = (aPlace.xz - uSlide * aPlace.y - uCentre.xy) / uCentre.z;
  gl_Position = vec4(ground, 0.0, 1.0);
  gl_PointSize = 2.0;
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

// One direction of a blur, narrow for the contact (red) and wide for the shadow (green).
export const BLUR_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D uSource;
uniform vec2 uStep;
out vec4 colour;
void main() {
  vec2 at = gl_FragCoord.xy / vec2(textureSize(uSource, 0));
  vec2 sum = texture(uSource, at).rg * vec2(0.5484, 0.2412);
  sum += (texture(uSource, at + 1.5 * uStep).rg + texture(uSource, at - 1.5 * uStep).rg) * vec2(0.2133, 0.2038);
  sum += (texture(uSource, at + 3.0 * uStep).rg + texture(uSource, at - 3.0 * uStep).rg) * vec2(0.0125, 0.1228);
  sum += (texture(uSource, at + 4.5 * uStep).rg + texture(uSource, at - 4.5 * uStep).rg) * vec2(0.0, 0.0528);
  colour = vec4(sum, 0.0, 1.0);
}`;

// A piece of the ground: a unit shape or a part of it, placed in the world.
export const GROUND_VERTEX = `#version 300 es
uniform mat4 uMatrix;
uniform vec3 uPlace; // x, z and half the width
uniform vec4 uPart; // of the shape: its middle, half its size
in vec2 aCorner;
out vec2 vGround;
out vec2 vCorner;
void main() {
  vCorner = uPart.xy + uPart.zw * aCorner;
  vGround = uPlace.xy + uPlace.z * vCorner;
  gl_Position = uMatrix * vec4(vGround.x, 0.0, vGround.y, 1.0);
}`;

export const FLOOR_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 uStage;
uniform vec3 uFloor;
uniform vec3 uLine;
in vec2 vGround;
in vec2 vCorner;
out vec4 colour;
void main() {
  vec2 widths = fwidth(vGround);
  vec2 off = abs(fract(vGround + 0.5) - 0.5); // metres to the next line
  vec2 lines = clamp((widths + 0.004 - off) / widths, 0.0, 1.0);
  float line = max(lines.x, lines.y) * clamp(1.2 - 8.0 * max(widths.x, widths.y), 0.0, 1.0);
  float fade = max(0.0, 1.0 - dot(vCorner, vCorner));
  colour = vec4(mix(uStage, mix(uFloor, uLine, line), fade * fade), 1.0);
}`;

// The shadow, drawn over the floor.
export const SHADE_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D uShadow;
uniform vec3 uShade;
uniform vec4 uSquare; // of the texture: its corner, its size
in vec2 vCorner;
out vec4 colour;
void main() {
  vec2 dark = texture(uShadow, uSquare.xy + uSquare.zw * (vCorner * 0.5 + 0.5)).rg;
  float inside = 1.0 - smoothstep(0.85, 1.0, max(abs(vCorner.x), abs(vCorner.y)));
  colour = vec4(uShade, inside * (1.0 - (1.0 - 0.66 * dark.r) * (1.0 - 0.62 * dark.g)));
}`;
