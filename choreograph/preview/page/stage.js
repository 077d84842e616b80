// The stage: the picture of a dancer, kept at the time of whoever plays the dance.

import { Camera } from "./camera.js";
import { Renderer } from "./renderer.js";

const SETTLED_MS = 120;

export class Stage {
  // onFrame is told the time shown, after each frame; the renderer is null where there is no WebGL 2.
  constructor(canvas, mesh, onFrame) {
    Object.assign(this, { canvas, onFrame });
    this.renderer = openRenderer(canvas, mesh);
    this.drawn = 0;
    this.lastAt = 0;
    this.asked = false;
    this.still = false; // nothing moves: a finer picture is worth its time
    new ResizeObserver(() => this.wake()).observe(canvas);
  }

  // A dance: who dances, and who keeps the time.
  show(dancer, player) {
    Object.assign(this, { dancer, player, camera: new Camera(dancer) });
    this.renderer?.show(dancer);
    this.wake();
  }

  // Ask for a frame; while the dance plays, each asks for the next.
  wake() {
    clearTimeout(this.settling);
    this.still = false;
    this.#ask();
  }

  #ask() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame((at) => this.#frame(at / 1000));
  }

  #frame(at) {
    this.asked = false;
    const { player, camera, renderer } = this;
    if (!player) return;
    const elapsed = Math.min(0.1, at - this.lastAt);
    const running = this.lastAt > 0 && at - this.lastAt < 0.25;
    this.lastAt = at;
    const time = player.tick(at);
    this.dancer.pose(time);
    const moving = camera.settle(elapsed);
    if (renderer) {
      if (running && player.playing) renderer.paced(elapsed);
      renderer.resize(this.still);
      renderer.draw(camera.at(time, renderer.canvas.width / renderer.canvas.height));
    }
    this.drawn += 1;
    this.onFrame(time);
    if (player.playing || moving) this.wake();
    else if (!this.still) this.settling = setTimeout(() => { this.still = true; this.#ask(); }, SETTLED_MS);
  }
}

function openRenderer(canvas, mesh) {
  try {
    return new Renderer(canvas, mesh);
  } catch (error) {
    if (error.message !== "no WebGL 2") throw error;
    return null;
  }
}
