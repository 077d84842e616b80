// Pointer, wheel and touch on the timeline.

import { clamp } from "./math.js";

export class Gestures {
  constructor(timeline) {
    this.timeline = timeline;
    this.touches = new Map();
    this.drag = null; // (x) => void while a button or finger is down
    const { element, overview } = timeline;
    element.addEventListener("pointerdown", (event) => this.#down(event));
    element.addEventListener("pointermove", (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel"]) element.addEventListener(name, (event) => this.#up(event));
    element.addEventListener("pointerleave", (event) => {
      if (!this.drag && event.pointerType !== "touch") this.#hover(null);
    });
    element.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    const jump = (event) => {
      if (event.buttons) timeline.player.seek((event.offsetX / overview.clientWidth) * timeline.durationS);
    };
    overview.addEventListener("pointerdown", (event) => { overview.setPointerCapture(event.pointerId); jump(event); });
    overview.addEventListener("pointermove", jump);
  }

  #x(event) { return event.clientX - this.timeline.element.getBoundingClientRect().left; }

  #down(event) {
    if (event.button > 0) return;
    const { timeline } = this;
    timeline.element.setPointerCapture(event.pointerId);
    this.touches.set(event.pointerId, this.#x(event));
    if (this.touches.size > 1) { this.#letGo(); return; }
    const x = this.#x(event);
    this.drag = this.begin(x, event);
    this.#hover(x);
  }

  // What dragging from x does: a function of the later x.
  begin(x, event) {
    const { timeline } = this, { player } = timeline, at = timeline.timeAt(x);
    const grip = event.pointerType === "touch" ? 14 : 6;
    const { on, from, to } = player.loop;
    if (event.shiftKey) return (x2) => player.setLoop(at, timeline.timeAt(x2));
    if (on && Math.abs(x - timeline.x(to)) < grip) return (x2) => player.setLoop(from, timeline.timeAt(x2));
    if (on && Math.abs(x - timeline.x(from)) < grip) return (x2) => player.setLoop(timeline.timeAt(x2), to);
    return this.scrub(x);
  }

  scrub(x) {
    const { timeline } = this, { player } = timeline;
    this.resume = player.playing;
    if (this.resume) player.pause();
    const seek = (x2) => player.seek(timeline.timeAt(x2));
    seek(x);
    return seek;
  }

  #move(event) {
    const x = this.#x(event);
    if (this.touches.has(event.pointerId)) {
      if (this.touches.size === 2) this.#pinch(event.pointerId, x);
      this.touches.set(event.pointerId, x);
    }
    this.drag?.(x);
    this.#hover(x);
  }

  #pinch(id, x) {
    const [other] = [...this.touches].filter(([key]) => key !== id).map(([, value]) => value);
    const before = this.touches.get(id);
    this.timeline.zoomBy(Math.max(20, Math.abs(x - other)) / Math.max(20, Math.abs(before - other)), other);
  }

  #up(event) {
    this.touches.delete(event.pointerId);
    this.#letGo();
    if (event.pointerType === "touch") this.leaving = setTimeout(() => this.#hover(null), 2500);
  }

  #letGo() {
    if (this.resume) this.timeline.player.play();
    this.resume = false;
    this.drag = null;
  }

  #wheel(event) {
    event.preventDefault();
    const { timeline } = this;
    const sideways = event.shiftKey ? event.deltaY : event.deltaX;
    if (Math.abs(sideways) > Math.abs(event.deltaY) || event.shiftKey) timeline.pan(sideways / timeline.pxPerS);
    else timeline.zoomBy(Math.exp(-clamp(event.deltaY, -120, 120) * 0.0025), this.#x(event));
    this.#hover(this.#x(event));
  }

  #hover(x) {
    clearTimeout(this.leaving);
    const { timeline } = this;
    timeline.pointer.hidden = x === null;
    if (x === null) { timeline.onHover(null); return; }
    timeline.pointer.style.transform = `translateX(${x}px)`;
    const index = timeline.blockAt(timeline.timeAt(x)), block = timeline.dance.blocks[index];
    timeline.onHover(index, clamp(timeline.x((block.start_s + block.end_s) / 2), 0, timeline.width));
  }
}
