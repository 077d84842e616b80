// The smoothed position of a dancer at a time, which the camera follows.

import { clamp } from "./math.js";

export const PATH_FPS = 10;
const SMOOTHING_S = 0.35; // standard deviation of the Gaussian that smooths the path

export class GroundPath {
  // roots: positions (T, 3), flat.
  constructor(roots, frames, fps) {
    this.places = smoothedPath(roots, frames, fps);
  }

  // The smoothed position on the ground: [x, z].
  at(timeS) {
    const last = this.places.length / 2 - 1;
    const at = clamp(timeS * PATH_FPS, 0, last);
    const low = Math.floor(at), high = Math.min(low + 1, last), f = at - low;
    return [0, 1].map((k) => this.places[2 * low + k] * (1 - f) + this.places[2 * high + k] * f);
  }

  // Middle of the path, and its radius.
  stage() {
    const xs = this.places.filter((_, i) => i % 2 === 0), zs = this.places.filter((_, i) => i % 2 === 1);
    const least = (v) => v.reduce((a, b) => Math.min(a, b)), most = (v) => v.reduce((a, b) => Math.max(a, b));
    const middle = [xs, zs].map((v) => (least(v) + most(v)) / 2);
    const radius = most(xs.map((x, i) => Math.hypot(x - middle[0], zs[i] - middle[1])));
    return { middle, radius };
  }
}

// Ground positions (N, 2) at PATH_FPS, smoothed by a centred Gaussian, so that the camera does not lag.
function smoothedPath(roots, frames, fps) {
  const count = Math.max(1, Math.ceil(((frames - 1) / fps) * PATH_FPS) + 1);
  const reach = Math.ceil(3 * SMOOTHING_S * PATH_FPS);
  const path = new Float32Array(2 * count);
  const at = (i) => 3 * clamp(Math.round((i / PATH_FPS) * fps), 0, frames - 1);
  for (let i = 0; i < count; i++) {
    let x = 0, z = 0, sum = 0;
    for (let d = -reach; d <= reach; d++) {
      const weight = Math.exp(-0.5 * (d / (SMOOTHING_S * PATH_FPS)) ** 2);
      const from = at(clamp(i + d, 0, count - 1));
      x += weight * roots[from];
      z += weight * roots[from + 2];
      sum += weight;
    }
    path[2 * i] = x / sum;
    path[2 * i + 1] = z / sum;
  }
  return path;
}
