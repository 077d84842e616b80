// The dancer at a time: interpolation between frames, forward kinematics, skinning matrices.

import { GroundPath } from "./ground_path.js";
import { clamp, matrixInto, multiplyInto, slerpInto } from "./math.js";

export class Dancer {
  constructor(dance, { roots, quats }) {
    this.fps = dance.fps;
    this.frames = dance.frames;
    this.joints = dance.names.length;
    this.parents = dance.parents;
    this.offsets = dance.offsets_m.flat();
    this.bindPlaces = dance.mesh.bind_pos_m.flat();
    this.bindTurns = dance.mesh.bind_quat.flatMap(([w, x, y, z]) => [w, -x, -y, -z]);
    this.roots = roots;
    this.quats = quats;
    this.positions = new Float64Array(3 * this.joints); // world, metres
    this.rotations = new Float64Array(4 * this.joints); // world
    this.skin = new Float32Array(12 * this.joints); // three rows of four a joint
    this.path = new GroundPath(roots, this.frames, this.fps);
    this.local = new Float64Array(4);
    this.turn = new Float64Array(4);
    this.matrix = new Float64Array(9);
    this.pose(0);
  }

  pose(timeS) {
    const frame = clamp(timeS * this.fps, 0, this.frames - 1);
    const low = Math.min(Math.floor(frame), Math.max(this.frames - 2, 0));
    const high = Math.min(low + 1, this.frames - 1);
    const f = frame - low;
    const { positions: p, rotations: r, local, matrix: m } = this;
    for (let j = 0; j < this.joints; j++) {
      slerpInto(local, 0, this.quats, 4 * (low * this.joints + j), this.quats, 4 * (high * this.joints + j), f);
      const parent = this.parents[j];
      if (parent < 0) {
        r.set(local, 0);
        for (let k = 0; k < 3; k++) p[k] = this.roots[3 * low + k] * (1 - f) + this.roots[3 * high + k] * f;
      } else {
        multiplyInto(r, 4 * j, r, 4 * parent, local, 0);
        matrixInto(m, r, 4 * parent);
        this.#shift(p, 3 * j, m, this.offsets, 3 * j, p, 3 * parent, 1);
      }
    }
    for (let j = 0; j < this.joints; j++) this.#skinOf(j);
  }

  // out = at + sign · M · v
  #shift(out, o, m, v, i, at, a, sign) {
    for (let k = 0; k < 3; k++)
      out[o + k] = at[a + k] + sign * (m[3 * k] * v[i] + m[3 * k + 1] * v[i + 1] + m[3 * k + 2] * v[i + 2]);
  }

  #skinOf(j) {
    const m = this.matrix;
    multiplyInto(this.turn, 0, this.rotations, 4 * j, this.bindTurns, 4 * j);
    matrixInto(m, this.turn, 0);
    this.#shift(this.local, 0, m, this.bindPlaces, 3 * j, this.positions, 3 * j, -1);
    for (let k = 0; k < 3; k++) {
      for (let l = 0; l < 3; l++) this.skin[12 * j + 4 * k + l] = m[3 * k + l];
      this.skin[12 * j + 4 * k + 3] = this.local[k];
    }
  }

  // Height of the standing body, metres.
  height() {
    let low = Infinity, high = -Infinity;
    for (let i = 1; i < this.bindPlaces.length; i += 3) {
      low = Math.min(low, this.bindPlaces[i]);
      high = Math.max(high, this.bindPlaces[i]);
    }
    return Math.max(high - low, 0.3) * 1.1;
  }
}
