// The stage: draws the dancer at the player's time. There are two kinds of dancers and of renderers: the mannequin's
// (skeleton.js, renderer.js) and the user's character's (figure.js, character_renderer.js).

import { Camera } from "./camera.js";

const SETTLED_MS = 120;
const SPARED = 2; // of three frames

export class Stage {
  // onFrame gets the time shown, after each frame. The renderer is null without WebGL 2.
  constructor(canvas, renderer, onFrame) {
    Object.assign(this, { canvas, renderer, onFrame });
    this.drawn = 0;
    this.lastAt = 0;
    this.frameRequested = false;
    this.still = false; // nothing moves: draw at full resolution
    this.isSparing = () => false; // whether other work needs the processor, which draws without a graphics card
    this.spared = 0; // frames since one was drawn
    new ResizeObserver(() => this.wake()).observe(canvas);
  }

  // Set the dancer, and the player that keeps the time. A camera that is there already keeps its view.
  show(dancer, player) {
    Object.assign(this, { dancer, player });
    if (this.camera) this.camera.look(dancer);
    else this.camera = new Camera(dancer);
    this.renderer?.show(dancer);
    this.spared = SPARED; // it is seen at once
    this.wake();
  }

  // Request a frame. While the dance plays, each frame requests the next.
  wake() {
    clearTimeout(this.settling);
    this.still = false;
    this.#requestFrame();
  }

  #requestFrame() {
    if (this.frameRequested) return;
    this.frameRequested = true;
    requestAnimationFrame((at) => this.#frame(at / 1000));
  }

  #frame(at) {
    this.frameRequested = false;
    const { canvas, player, camera, renderer } = this;
    if (!player) return;
    const sparing = renderer?.resolution?.slowMachine && player.playing && this.isSparing();
    if (sparing && this.spared < SPARED) {
      this.spared += 1;
      this.#requestFrame();
      return;
    }
    this.spared = 0;
    const elapsed = Math.min(0.1, at - this.lastAt);
    const running = this.lastAt > 0 && at - this.lastAt < 0.25;
    this.lastAt = at;
    const time = player.tick(at);
    this.dancer.pose(time);
    const moving = camera.settle(elapsed);
    if (renderer) {
      if (running && player.playing && !sparing) renderer.resolution.reportFrameTime(elapsed);
      renderer.resize(this.still);
      renderer.draw(camera.at(time, canvas.width / canvas.height));
    }
    this.drawn += 1;
    this.onFrame(time);
    if (player.playing || moving) this.wake();
    else if (!this.still) this.settling = setTimeout(() => { this.still = true; this.#requestFrame(); }, SETTLED_MS);
  }
}
