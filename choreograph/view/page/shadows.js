// Soft shadows of the bodies on the floor. Each has a square of one texture, so that all are made at once.

import { clamp } from "./math.js";
import { BLUR_FRAGMENT, BLUR_VERTEX, GROUND_VERTEX, SHADE_FRAGMENT, SHADOW_FRAGMENT, SHADOW_VERTEX } from "./shaders.js";
import { program, shape, target } from "./webgl.js";

const SIZE = 80; // texels of a square
const GAP = 6; // texels between two squares, the reach of the blur
const IN_ROW = 8; // squares
const HALF_M = 1.5;
const MARGIN_M = 0.45; // margin of a shadow around that of the joints, for the flesh and the blur radius

export class Shadows {
  // slide: metres to the side of a shadow, x and z, by a metre of height.
  constructor(gl, count, slide) {
    Object.assign(this, { gl, count, slide });
    this.shadow = program(gl, SHADOW_VERTEX, SHADOW_FRAGMENT);
    this.blur = program(gl, BLUR_VERTEX, BLUR_FRAGMENT);
    this.shade = program(gl, GROUND_VERTEX, SHADE_FRAGMENT);
    this.square = shape(gl, [-1, -1, 1, -1, 1, 1, -1, 1]);
    this.empty = gl.createVertexArray();
    const length = (squares) => squares * SIZE + (squares - 1) * GAP;
    this.size = [length(Math.min(count, IN_ROW)), length(Math.ceil(count / IN_ROW))];
    this.targets = [0, 1].map(() => target(gl, ...this.size));
  }

  // The texels at which the square of a body begins: [x, y].
  #corner(i) { return [(i % IN_ROW) * (SIZE + GAP), Math.floor(i / IN_ROW) * (SIZE + GAP)]; }

  // The middle of the ground that is in the square of a dancer, and half its width: [x, z, half].
  #centre({ positions: p }) {
    return [p[0] - this.slide[0] * p[1] * 0.5, p[2] - this.slide[1] * p[1] * 0.5, HALF_M];
  }

  // Make the shadows of bodies. quick: of some of their points.
  make(bodies, dancers, quick) {
    const { gl, shadow, blur, targets, size } = this;
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.bindFramebuffer(gl.FRAMEBUFFER, targets[0].frame);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendEquation(gl.MAX);
    gl.useProgram(shadow.program);
    gl.uniform2fv(shadow.uSlide, this.slide);
    bodies.forEach((body, i) => {
      gl.viewport(...this.#corner(i), SIZE, SIZE);
      gl.uniform3fv(shadow.uCentre, this.#centre(dancers[i]));
      body.drawPoints(gl, quick);
    });
    gl.disable(gl.BLEND);
    gl.enable(gl.SCISSOR_TEST);
    gl.viewport(0, 0, ...size);
    gl.useProgram(blur.program);
    gl.uniform1i(blur.uSource, 0);
    gl.bindVertexArray(this.empty);
    // Across with the rows that are then blurred along.
    for (const [from, to, step, more] of [[0, 1, [1, 0], GAP], [1, 0, [0, 1], 0]]) {
      gl.bindFramebuffer(gl.FRAMEBUFFER, targets[to].frame);
      gl.bindTexture(gl.TEXTURE_2D, targets[from].texture);
      gl.uniform2f(blur.uStep, step[0] / size[0], step[1] / size[1]);
      dancers.forEach((dancer, i) => {
        gl.scissor(...this.#texels(i, dancer, more));
        gl.drawArrays(gl.TRIANGLES, 0, 3);
      });
    }
    gl.disable(gl.SCISSOR_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  // The part of the square that can hold a shadow, -1 to 1: [x, z, half width, half depth].
  #bounds({ positions: p }, [x, z, half]) {
    const { slide } = this;
    let left = 1, back = 1, right = -1, front = -1;
    for (let i = 0; i < p.length; i += 3) {
      const offX = p[i] - slide[0] * p[i + 1] - x, offZ = p[i + 2] - slide[1] * p[i + 1] - z;
      left = Math.min(left, (offX - MARGIN_M) / half);
      right = Math.max(right, (offX + MARGIN_M) / half);
      back = Math.min(back, (offZ - MARGIN_M) / half);
      front = Math.max(front, (offZ + MARGIN_M) / half);
    }
    left = clamp(left, -1, 1); right = clamp(right, -1, 1); back = clamp(back, -1, 1); front = clamp(front, -1, 1);
    return [(left + right) / 2, (back + front) / 2, (right - left) / 2, (front - back) / 2];
  }

  // The texels of that part, with more rows at both ends: [x, y, width, height].
  #texels(i, dancer, more) {
    const [x, z, width, depth] = this.#bounds(dancer, this.#centre(dancer)), [left, low] = this.#corner(i);
    const texel = (at) => clamp(((at + 1) / 2) * SIZE, 0, SIZE);
    const [first, end] = [Math.floor(texel(x - width)), Math.ceil(texel(x + width))];
    const [from, to] = [Math.floor(texel(z - depth)) - more, Math.ceil(texel(z + depth)) + more].map((v) => clamp(v, 0, SIZE));
    return [left + first, low + from, end - first, to - from];
  }

  // Draw the shadows over the floor. Depth is not written, since they lie in its plane.
  draw(dancers, matrix, colour) {
    const { gl, shade, size } = this;
    gl.depthMask(false);
    gl.enable(gl.BLEND);
    gl.blendEquation(gl.FUNC_ADD);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.bindTexture(gl.TEXTURE_2D, this.targets[0].texture);
    gl.useProgram(shade.program);
    gl.uniform1i(shade.uShadow, 0);
    gl.uniformMatrix4fv(shade.uMatrix, false, matrix);
    gl.uniform3fv(shade.uShade, colour);
    gl.bindVertexArray(this.square);
    dancers.forEach((dancer, i) => {
      const centre = this.#centre(dancer), [x, y] = this.#corner(i);
      gl.uniform4f(shade.uSquare, x / size[0], y / size[1], SIZE / size[0], SIZE / size[1]);
      gl.uniform3fv(shade.uPlace, centre);
      gl.uniform4fv(shade.uPart, this.#bounds(dancer, centre));
      gl.drawArrays(gl.TRIANGLE_FAN, 0, 4);
    });
    gl.disable(gl.BLEND);
    gl.depthMask(true);
  }
}
