// Draws the dancer, or several, on the floor with WebGL 2: a skinned mesh and a shadow each, a disc.

import { Body, coarseMesh } from "./body.js";
import { normalized } from "./math.js";
import { Resolution, openWebgl } from "./resolution.js";
import { FLOOR_FRAGMENT, GROUND_VERTEX, bodyShaders } from "./shaders.js";
import { Shadows } from "./shadows.js";
import { stageColours } from "./stage_colours.js";
import { program, shape } from "./webgl.js";

const RIM_POINTS = 48;
const LIGHT_HEIGHT = 1.35; // of a light one metre to the side
const LIGHT_SIDE = [Math.sin(-0.7), Math.cos(-0.7)]; // the direction of the key light, x and z, from the audience
const LIGHT = normalized([LIGHT_SIDE[0], LIGHT_HEIGHT, LIGHT_SIDE[1]]);
const SLIDE = LIGHT_SIDE.map((v) => 0.75 * (v / LIGHT_HEIGHT)); // a high, wide light with short shadows
const FINE_PIXELS = 100; // in a metre, from which on one of several bodies shows all of its detail

export class Renderer {
  // A renderer on a canvas, or null in a browser without WebGL 2. mesh: that of the dancer, or a list for several.
  static open(canvas, mesh) {
    const resolution = new Resolution(canvas), gl = openWebgl(canvas, resolution);
    return gl && new Renderer(gl, resolution, mesh);
  }

  constructor(gl, resolution, mesh) {
    const { canvas } = gl;
    Object.assign(this, { gl, canvas, resolution });
    const meshes = [mesh].flat();
    this.bodies = meshes.map((one) => new Body(one, 2));
    // In software rendering, several bodies are drawn with less detail where they are small.
    const isCrowd = resolution.slowMachine && meshes.length > 1;
    this.coarse = isCrowd ? meshes.map((one) => new Body(coarseMesh(one), 3)) : null;
    this.rim = [0.3, 0.3, 0.3];
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { this.#build(); this.draw(this.last); });
    this.#build();
  }

  // Sets the dancer, or the dancers, to draw.
  show(dancer) { this.dancers = dancer.dancers ?? [dancer]; }

  #build() {
    const { gl } = this;
    this.surfaces = { fine: program(gl, ...bodyShaders(true)), quick: program(gl, ...bodyShaders(false)) };
    this.floor = program(gl, GROUND_VERTEX, FLOOR_FRAGMENT);
    for (const body of [...this.bodies, ...(this.coarse ?? [])]) body.upload(gl);
    const angles = Array.from({ length: RIM_POINTS }, (_, i) => (2 * Math.PI * i) / RIM_POINTS);
    this.disc = shape(gl, angles.flatMap((angle) => [Math.cos(angle), Math.sin(angle)]));
    this.shadows = new Shadows(gl, this.bodies.length, SLIDE);
    this.readColours();
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
    const { gl, dancers } = this, quick = this.resolution.slowMachine && !this.still;
    this.last = view;
    const bodies = this.bodies.map((body, i) => (this.#isSmall(view, dancers[i]) ? this.coarse[i] : body));
    bodies.forEach((body, i) => body.pose(gl, dancers[i].skin));
    this.shadows.make(bodies, dancers, quick);
    this.#drawBodies(view, bodies, this.surfaces[quick ? "quick" : "fine"]);
    this.#drawFloor(view);
    this.shadows.draw(dancers, view.matrix, this.colours.shade);
  }

  // Whether less detail is enough for a dancer in a view.
  #isSmall({ matrix: m }, { positions: p }) {
    if (!this.coarse || this.still) return false;
    const away = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
    return Math.hypot(m[1], m[5], m[9]) * this.canvas.height < 2 * FINE_PIXELS * away;
  }

  #drawBodies({ eye, matrix, mirrored }, bodies, surface) {
    const { gl, colours } = this;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...colours.stage, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.frontFace(mirrored ? gl.CW : gl.CCW);
    gl.useProgram(surface.program);
    gl.uniformMatrix4fv(surface.uMatrix, false, matrix);
    gl.uniform3fv(surface.uEye, eye);
    gl.uniform3fv(surface.uLight, LIGHT);
    gl.uniform3fv(surface.uRim, this.rim);
    gl.uniform3fv(surface.uGround, this.ground);
    gl.uniform1f(surface.uExposure, this.exposure);
    for (const body of bodies) body.draw(gl);
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
}
