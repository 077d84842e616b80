// Orbit controls of the stage: drag to orbit, wheel or pinch to zoom.

export class OrbitControls {
  constructor(stage) {
    const { canvas: view } = stage;
    Object.assign(this, { stage, fingers: new Map() });
    view.addEventListener("pointerdown", (event) => {
      view.setPointerCapture(event.pointerId);
      this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    view.addEventListener("pointermove", (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel"]) {
      view.addEventListener(name, (event) => this.fingers.delete(event.pointerId));
    }
    view.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    view.addEventListener("dblclick", () => { stage.camera.reset(); stage.wake(); });
  }

  #move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const here = [event.clientX, event.clientY];
    const others = [...this.fingers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    const share = 1 / this.fingers.size; // two fingers moving together orbit no faster than one
    this.stage.camera.turn(-(here[0] - before[0]) * 0.008 * share, (here[1] - before[1]) * 0.006 * share);
    if (others.length) {
      const apart = ([x, y]) => Math.max(20, Math.hypot(x - others[0][0], y - others[0][1]));
      this.stage.camera.approach(apart(here) / apart(before));
    }
    this.fingers.set(event.pointerId, here);
    this.stage.wake();
  }

  #wheel(event) {
    event.preventDefault();
    this.stage.camera.approach(Math.exp(-Math.max(-120, Math.min(120, event.deltaY)) * 0.0018));
    this.stage.wake();
  }
}
