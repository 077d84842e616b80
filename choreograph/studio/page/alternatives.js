// What else could be danced in the selected span: small figures that play in place, with the song, and can be chosen.

import { createElement } from "/page/elements.js";
import { post } from "./api.js";
import { attempt } from "./messages.js";

const SHOWN = 8;

export class Alternatives {
  constructor(store, jobs, actions, figures, getPlayer) {
    Object.assign(this, { store, jobs, actions, figures, getPlayer, asked: null, key: "" });
    this.list = document.getElementById("alternatives");
    this.note = document.getElementById("alternatives-note");
    store.addEventListener("spanend", () => this.look());
    store.addEventListener("span", () => { if (!store.span) this.#empty(); });
    store.addEventListener("state", () => { if (this.key && this.key !== this.#key()) this.look(); });
  }

  #key() {
    const { span, state } = this.store;
    return span ? `${state.revision} ${span.from} ${span.to}` : "";
  }

  #empty() {
    this.asked?.abort();
    this.key = "";
    this.figures.clear(this.list);
    this.list.replaceChildren();
    this.note.textContent = "";
  }

  // Ask for the alternatives of the selected span. A newer question cancels an older one.
  async look() {
    const { store, jobs } = this, { span } = store;
    if (!span || !store.dance || !store.has("alternatives")) { this.#empty(); return; }
    this.#empty();
    this.key = this.#key();
    const { key } = this;
    this.asked = new AbortController();
    if (store.isLocked((span.from + span.to) / 2)) { this.note.textContent = "This span is locked. Unlock it to change it."; return; }
    this.note.textContent = "Looking for alternatives";
    this.list.setAttribute("aria-busy", "true");
    await attempt(async () => {
      try {
        const question = { revision: store.state.revision, ...span, n: SHOWN };
        const found = await jobs.finish(await post("alternatives", question), "Looking for alternatives", { quiet: true, signal: this.asked.signal });
        if (key === this.key) await this.#show(Array.isArray(found) ? found : found.alternatives ?? []);
      } catch (error) {
        if (key !== this.key) return;
        this.note.textContent = "";
        throw error;
      } finally {
        if (key === this.key) this.list.removeAttribute("aria-busy");
      }
    });
  }

  async #show(found) {
    this.note.textContent = found.length
      ? `${found.length} alternatives, the best first. Hover or focus to play, press to choose.`
      : "Nothing else in these takes fits here. Try a longer or shorter span.";
    const accent = getComputedStyle(document.documentElement).getPropertyValue("--figure").trim();
    for (const [i, alternative] of found.entries()) {
      const canvas = createElement("canvas");
      canvas.setAttribute("aria-hidden", "true");
      const button = createElement("button", "figure", [
        canvas,
        createElement("span", "why", [alternative.why]),
        createElement("span", "cost", [`cost ${alternative.cost.toFixed(2)}`]),
      ]);
      button.type = "button";
      button.dataset.id = alternative.id;
      button.setAttribute("aria-label", `Alternative ${i + 1}: ${alternative.why}, cost ${alternative.cost.toFixed(2)}`);
      button.title = Object.entries(alternative.costs).map(([name, cost]) => `${name} ${cost.toFixed(2)}`).join(", ");
      this.list.append(createElement("li", "", [button]));
      button.addEventListener("click", () => this.#choose(alternative, button));
      const figure = await this.figures.add(canvas, alternative, accent);
      this.#playOnHover(button, figure, alternative);
    }
  }

  // While the pointer or focus is here, the song plays the span and the figure dances to it.
  #playOnHover(button, figure, alternative) {
    const from = alternative.facts.from_s ?? Math.max(0, alternative.start_s - 0.5);
    let was = null;
    const start = () => {
      if (was) return;
      const player = this.getPlayer();
      was = { time: player.time, playing: player.playing, loop: player.loop };
      player.loop = { on: true, from, to: Math.min(player.durationS, from + figure.durationS) };
      player.seek(from);
      player.play();
      figure.clock = () => Math.max(0, player.time - from);
      this.figures.wake();
    };
    const stop = () => {
      if (!was) return;
      const player = this.getPlayer();
      player.loop = was.loop;
      if (!was.playing) player.pause();
      player.seek(was.time);
      was = null;
      figure.clock = null;
    };
    for (const name of ["pointerenter", "focus"]) button.addEventListener(name, start);
    for (const name of ["pointerleave", "blur"]) button.addEventListener(name, stop);
    button.stop = stop;
  }

  async #choose(alternative, button) {
    button.stop?.();
    button.setAttribute("aria-busy", "true");
    const timer = performance.now();
    await this.actions.choose(alternative);
    this.lastChoiceMs = performance.now() - timer;
    button.removeAttribute("aria-busy");
  }
}
