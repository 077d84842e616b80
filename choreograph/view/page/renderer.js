// Draws the dancer, or several, on the floor with WebGL 2: a skinned mesh and a shadow each, a disc.

import { clamp, normalized } from "./math.js";
import { Resolution, openWebgl } from "./resolution.js";
import { Skin } from "./skin.js";
import {
  BLUR_FRAGMENT, BLUR_VERTEX, FLOOR_FRAGMENT, GROUND_VERTEX, SHADE_FRAGMENT, SHADOW_FRAGMENT, SHADOW_VERTEX,
  bodyShaders,
} from "./shaders.js";
import { stageColours } from "./stage_colours.js";

const SHADOW_SIZE = 80; // texels
const SHADOW_HALF_M = 1.5;
const SHADOW_MARGIN_M = 0.45; // margin of a shadow around that of the joints, for the flesh and the blur radius
const RIM_POINTS = 48;
const KEY_SIDE_RAD = -0.7; // from the audience
const LIGHT_HEIGHT = 1.35; // of a light one metre to the side
const ATTRIBUTES = ["aPlace", "aNormal", "aColour", "aCorner"];

export class Renderer {
  // A renderer on a canvas, or null in a browser without WebGL 2. mesh: that of the dancer, or a list for several.
  static open(canvas, mesh) {
    const resolution = new Resolution(canvas), gl = openWebgl(canvas, resolution);
    return gl && new Renderer(gl, resolution, mesh);
  }

  constructor(gl, resolution, mesh) {
    const { canvas } = gl;
    Object.assign(this, { gl, canvas, resolution });
    this.bodies = [mesh].flat().map((one) => ({ mesh: one, skin: new Skin(one) }));
    this.rim = [0.3, 0.3, 0.3];
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { this.#build(); this.draw(this.last); });
    this.#build();
  }

  // Sets the dancer to draw, and a key light from the side of the audience.
  show(dancer) {
    this.dancers = dancer.dancers ?? [dancer];
    const [x, z] = [Math.sin(KEY_SIDE_RAD), Math.cos(KEY_SIDE_RAD)];
    this.light = normalized([x, LIGHT_HEIGHT, z]);
    this.slide = [x / LIGHT_HEIGHT, z / LIGHT_HEIGHT].map((v) => 0.75 * v); // a high, wide light with short shadows
  }

  #build() {
    const { gl } = this;
    this.surfaces = { fine: program(gl, ...bodyShaders(true)), quick: program(gl, ...bodyShaders(false)) };
    this.shadow = program(gl, SHADOW_VERTEX, SHADOW_FRAGMENT);
    this.blur = program(gl, BLUR_VERTEX, BLUR_FRAGMENT);
    this.floor = program(gl, GROUND_VERTEX, FLOOR_FRAGMENT);
    this.shade = program(gl, GROUND_VERTEX, SHADE_FRAGMENT);
    for (const body of this.bodies) this.#upload(body);
    const angles = Array.from({ length: RIM_POINTS }, (_, i) => (2 * Math.PI * i) / RIM_POINTS);
    this.disc = shape(gl, angles.flatMap((angle) => [Math.cos(angle), Math.sin(angle)]));
    this.square = shape(gl, [-1, -1, 1, -1, 1, 1, -1, 1]);
    this.empty = gl.createVertexArray();
    this.shades = [0, 1].map(() => target(gl, SHADOW_SIZE));
    this.readColours();
  }

  #upload(body) {
    const { gl } = this, { mesh, skin } = body;
    body.skinned = gl.createVertexArray();
    gl.bindVertexArray(body.skinned);
    body.buffers = {
      places: attribute(gl, "aPlace", skin.places, 3, gl.FLOAT),
      normals: attribute(gl, "aNormal", skin.normals, 3, gl.FLOAT),
    };
    attribute(gl, "aColour", mesh.colours, 3, gl.UNSIGNED_BYTE);
    body.points = gl.createVertexArray(); // every second vertex, enough for a shadow that is blurred
    gl.bindVertexArray(body.points);
    gl.bindBuffer(gl.ARRAY_BUFFER, body.buffers.places);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 24, 0);
    gl.bindVertexArray(body.skinned);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.indices, gl.STATIC_DRAW);
  }

  readColours() {
    const { exposure, ...colours } = stageColours();
    Object.assign(this, { colours, exposure, ground: colours.floor.map((v) => 0.12 + 0.55 * v * v) });
  }

  // Fit the drawing buffer to the element. `still` is for a picture that will not change.
  resize(still) {
    this.still = still;
    const [width, height] = this.resolution.size(still);
    if (this.canvas.width === width && this.canvas.height === height) return;
    this.canvas.width = width;
    this.canvas.height = height;
  }

  draw(view) {
    const { gl } = this;
    this.last = view;
    this.bodies.forEach(({ skin, buffers }, i) => {
      skin.pose(this.dancers[i].skin);
      for (const name of ["places", "normals"]) {
        gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
        gl.bufferSubData(gl.ARRAY_BUFFER, 0, skin[name]);
      }
    });
    this.#drawBodies(view);
    this.#drawFloor(view);
    this.bodies.forEach((body, i) => {
      const { positions: p } = this.dancers[i];
      const centre = [p[0] - this.slide[0] * p[1] * 0.5, p[2] - this.slide[1] * p[1] * 0.5, SHADOW_HALF_M];
      this.#drawShadow(body, centre);
      this.#drawShade(view, p, centre);
    });
  }

  // The part of the shadow's square that can hold a shadow, -1 to 1: [x, z, half width, half depth].
  #shadeBounds(p, [x, z, half]) {
    const { slide } = this;
    let left = 1, back = 1, right = -1, front = -1;
    for (let i = 0; i < p.length; i += 3) {
      const offX = p[i] - slide[0] * p[i + 1] - x, offZ = p[i + 2] - slide[1] * p[i + 1] - z;
      left = Math.min(left, (offX - SHADOW_MARGIN_M) / half);
      right = Math.max(right, (offX + SHADOW_MARGIN_M) / half);
      back = Math.min(back, (offZ - SHADOW_MARGIN_M) / half);
      front = Math.max(front, (offZ + SHADOW_MARGIN_M) / half);
    }
    left = clamp(left, -1, 1); right = clamp(right, -1, 1); back = clamp(back, -1, 1); front = clamp(front, -1, 1);
    return [(left + right) / 2, (back + front) / 2, (right - left) / 2, (front - back) / 2];
  }

  #drawShadow({ mesh, skinned, points }, centre) {
    const { gl, shadow, blur, shades } = this;
    gl.viewport(0, 0, SHADOW_SIZE, SHADOW_SIZE);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.bindFramebuffer(gl.FRAMEBUFFER, shades[0].frame);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendEquation(gl.MAX);
    gl.useProgram(shadow.program);
    gl.uniform3fv(shadow.uCentre, centre);
    gl.uniform2fv(shadow.uSlide, this.slide);
    const isQuick = this.resolution.slowMachine && !this.still;
    gl.bindVertexArray(isQuick ? points : skinned);
    gl.drawArrays(gl.POINTS, 0, mesh.weights.length >> (isQuick ? 1 : 0));
    gl.disable(gl.BLEND);
    gl.useProgram(blur.program);
    gl.uniform1i(blur.uSource, 0);
    gl.bindVertexArray(this.empty);
    for (const [from, to, step] of [[0, 1, [1, 0]], [1, 0, [0, 1]]]) {
      gl.bindFramebuffer(gl.FRAMEBUFFER, shades[to].frame);
      gl.bindTexture(gl.TEXTURE_2D, shades[from].texture);
      gl.uniform2f(blur.uStep, step[0] / SHADOW_SIZE, step[1] / SHADOW_SIZE);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  #drawBodies({ eye, matrix, mirrored }) {
    const { gl, colours } = this;
    const body = this.surfaces[this.resolution.slowMachine && !this.still ? "quick" : "fine"];
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...colours.stage, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.frontFace(mirrored ? gl.CW : gl.CCW);
    gl.useProgram(body.program);
    gl.uniformMatrix4fv(body.uMatrix, false, matrix);
    gl.uniform3fv(body.uEye, eye);
    gl.uniform3fv(body.uLight, this.light);
    gl.uniform3fv(body.uRim, this.rim);
    gl.uniform3fv(body.uGround, this.ground);
    gl.uniform1f(body.uExposure, this.exposure);
    for (const { skinned, mesh } of this.bodies) {
      gl.bindVertexArray(skinned);
      gl.drawElements(gl.TRIANGLES, mesh.indices.length, gl.UNSIGNED_INT, 0);
    }
  }

  // Depth is not written, since the floor is below the bodies, and the shadows lie in the plane of the floor.
  #drawFloor({ target: at, matrix, floorRadius }) {
    const { gl, floor, colours } = this;
    gl.disable(gl.CULL_FACE);
    gl.depthMask(false);
    gl.useProgram(floor.program);
    gl.uniformMatrix4fv(floor.uMatrix, false, matrix);
    gl.uniform3fv(floor.uPlace, [at[0], at[2], floorRadius]);
    gl.uniform4f(floor.uPart, 0, 0, 1, 1);
    gl.uniform3fv(floor.uStage, colours.stage);
    gl.uniform3fv(floor.uFloor, colours.floor);
    gl.uniform3fv(floor.uLine, colours.line);
    gl.bindVertexArray(this.disc);
    gl.drawArrays(gl.TRIANGLE_FAN, 0, RIM_POINTS);
    gl.depthMask(true);
  }

  #drawShade({ matrix }, positions, centre) {
    const { gl, shade, colours } = this;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(false);
    gl.enable(gl.BLEND);
    gl.blendEquation(gl.FUNC_ADD);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.bindTexture(gl.TEXTURE_2D, this.shades[0].texture);
    gl.useProgram(shade.program);
    gl.uniform1i(shade.uShadow, 0);
    gl.uniformMatrix4fv(shade.uMatrix, false, matrix);
    gl.uniform3fv(shade.uPlace, centre);
    gl.uniform4fv(shade.uPart, this.#shadeBounds(positions, centre));
    gl.uniform3fv(shade.uShade, colours.shade);
    gl.bindVertexArray(this.square);
    gl.drawArrays(gl.TRIANGLE_FAN, 0, 4);
    gl.disable(gl.BLEND);
    gl.depthMask(true);
  }
}

// A linked program and the locations of its uniforms by name.
function program(gl, vertex, fragment) {
  const linked = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(linked, shader);
  }
  ATTRIBUTES.forEach((name, i) => gl.bindAttribLocation(linked, i, name));
  gl.linkProgram(linked);
  if (!gl.getProgramParameter(linked, gl.LINK_STATUS) && !gl.isContextLost()) {
    const logs = gl.getAttachedShaders(linked).map((shader) => gl.getShaderInfoLog(shader));
    throw new Error(`${gl.getProgramInfoLog(linked)} ${logs.join(" ")}`);
  }
  const places = { program: linked };
  for (let i = 0; i < gl.getProgramParameter(linked, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(linked, i);
    places[name] = gl.getUniformLocation(linked, name);
  }
  return places;
}

function attribute(gl, name, data, size, type) {
  const at = ATTRIBUTES.indexOf(name), buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
  gl.enableVertexAttribArray(at);
  gl.vertexAttribPointer(at, size, type, type !== gl.FLOAT, 0, 0);
  return buffer;
}

// A fan of corners (N, 2) on the ground.
function shape(gl, corners) {
  const made = gl.createVertexArray();
  gl.bindVertexArray(made);
  attribute(gl, "aCorner", new Float32Array(corners), 2, gl.FLOAT);
  return made;
}

// A render target: a texture and its framebuffer.
function target(gl, size) {
  const made = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, made);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RG8, size, size);
  const frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, made, 0);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  return { texture: made, frame };
}
