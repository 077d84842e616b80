// An orbit camera around the dancer, or around the middle of the stage.

import { clamp, lookAt, multiplyMatrices, perspective } from "./math.js";

export const FOV_Y = 0.5;
const FIRST_PITCH = 0.14;
const FIRST_TURN = 0.17; // from +Z, the direction of the audience, since a body looks flat straight from the front
const BLEND_S = 0.45;
const FLOOR_RADIUS_M = 7;

export class Camera {
  constructor(dancer) {
    this.look(dancer);
    this.following = true;
    this.blend = 1; // 1: on the dancer, 0: on the stage
    this.mirrored = false;
    this.reset();
  }

  // Look at another dancer, from where the camera is.
  look(dancer) {
    this.dancer = dancer;
    this.height = dancer.height();
    this.stage = dancer.path.stage();
    this.spread = dancer.spread ?? 0; // of several dancers to each side, metres
  }

  reset() {
    this.yaw = this.spread ? 0 : FIRST_TURN; // several dancers are placed to be seen from the front
    this.pitch = FIRST_PITCH;
    this.closeness = 1;
    this.filming = true; // if there is a film, until the viewer turns the view
  }

  // The shot of the film that is shown at a time, or null.
  shot(timeS) { return this.film && this.filming ? this.film.shot(timeS) : null; }

  // Orbit, in radians. In a mirrored view the picture still follows the pointer.
  turn(yaw, pitch) {
    this.filming = false;
    this.yaw += this.mirrored ? -yaw : yaw;
    this.pitch = clamp(this.pitch + pitch, 0.015, 1.5);
  }

  approach(factor) {
    this.filming = false;
    this.closeness = clamp(this.closeness * factor, 0.35, 6);
  }

  // Advances the blend between dancer and stage by real time. True while it is still moving.
  settle(elapsedS) {
    const goal = this.following ? 1 : 0;
    const step = elapsedS / BLEND_S;
    this.blend = goal > this.blend ? Math.min(goal, this.blend + step) : Math.max(goal, this.blend - step);
    return this.blend !== goal;
  }

  // The data for a renderer: eye, target, and the matrix from the world to the screen.
  at(timeS, aspect) {
    if (this.shot(timeS)) {
      const { eye, target } = this.film.at(timeS, aspect);
      return this.view(eye, target, aspect, FLOOR_RADIUS_M + this.stage.radius + this.spread);
    }
    const eased = this.blend * this.blend * (3 - 2 * this.blend);
    const stands = this.dancer.path.at(timeS);
    const [x, z] = stands.map((v, k) => v * eased + this.stage.middle[k] * (1 - eased));
    const tall = this.height * 0.62;
    const wide = this.height * 0.52 + this.stage.radius * (1 - eased) + this.spread;
    const tan = Math.tan(FOV_Y / 2);
    const far = Math.max(tall / tan, wide / (tan * aspect)) + this.stage.radius * 0.6 * (1 - eased);
    const distance = far / this.closeness;
    // At a short distance, the camera points to the chest and face.
    const target = [x, this.height * (0.5 + 0.26 * clamp((this.closeness - 1) / 1.5, 0, 1)), z];
    const flat = Math.cos(this.pitch) * distance;
    const eye = [
      x + Math.sin(this.yaw) * flat,
      target[1] + Math.sin(this.pitch) * distance,
      z + Math.cos(this.yaw) * flat,
    ];
    return this.view(eye, target, aspect, FLOOR_RADIUS_M + this.stage.radius * (1 - eased) + this.spread);
  }

  view(eye, target, aspect, floorRadius) {
    const projection = perspective(FOV_Y, aspect, 0.05, 60 + 10 * this.spread);
    if (this.mirrored) projection[0] = -projection[0];
    return { eye, target, matrix: multiplyMatrices(projection, lookAt(eye, target)), mirrored: this.mirrored, floorRadius };
  }
}
