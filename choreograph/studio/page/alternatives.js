// What else could be danced in the selected span: small figures that play in place, with the song, and can be chosen.

import { createElement } from "/page/elements.js";
import { post } from "./api.js";
import { attempt } from "./messages.js";

const SHOWN = 8;
const AGAIN_MS = 700; // after another dance is shown

export class Alternatives {
  constructor(store, jobs, actions, figures, getPlayer) {
    Object.assign(this, { store, jobs, actions, figures, getPlayer, asked: null, key: "" });
    this.list = document.getElementById("alternatives");
    this.note = document.getElementById("alternatives-note");
    store.addEventListener("spanend", () => this.look());
    store.addEventListener("span", () => { if (!store.span) this.#empty(); });
    store.addEventListener("shown", () => this.#lookAgain());
  }

  #key() {
    const { span, state } = this.store;
    return span ? `${state.revision} ${span.from} ${span.to}` : "";
  }

  #empty() {
    clearTimeout(this.waiting);
    this.asked?.abort();
    this.key = "";
    this.figures.clear(this.list);
    this.list.replaceChildren();
    this.note.textContent = "";
  }

  // Look again when another dance is there, a moment later, so that it plays first.
  #lookAgain() {
    if (!this.key || this.key === this.#key()) return;
    this.#empty(); // they are of the dance before
    this.note.textContent = "Looking for alternatives";
    this.#lookSoon();
  }

  // Not while the dance is being changed, when the question would be of a dance that is no longer there.
  #lookSoon() {
    const isChanging = () => this.jobs.running || this.store.changing;
    this.waiting = setTimeout(() => { if (isChanging()) this.#lookSoon(); else this.look(); }, AGAIN_MS);
  }

  // Look again if the panel is opened with another span or dance than it has shown.
  open() { if (this.key !== this.#key()) this.look(); }

  // Ask for the alternatives of the selected span, if the panel is open. A newer question cancels an older one.
  async look() {
    const { store, jobs } = this, { span } = store;
    this.#empty();
    if (!span || !store.dance || this.list.closest("[role=tabpanel]").hidden) return;
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
        if (key === this.key) await this.#show(found, key);
      } catch (error) {
        if (key !== this.key) return;
        this.note.textContent = "";
        throw error;
      } finally {
        if (key === this.key) this.list.removeAttribute("aria-busy");
      }
    });
  }

  async #show(found, key) {
    this.note.textContent = found.length
      ? `${found.length} alternatives, the best first. ${matchMedia("(hover: hover)").matches ? "Point at one to play it, press" : "Press"} to choose.`
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
      if (key !== this.key) return; // another span has been selected meanwhile
      this.#playOnHover(button, figure, alternative);
    }
  }

  // While the pointer or focus is here, the song plays the span and the figure dances to it.
  #playOnHover(button, figure, alternative) {
    const from = alternative.from_s, player = this.getPlayer();
    let was = null;
    const start = () => {
      if (was) return;
      was = { time: player.time, playing: player.playing, looping: player.loop.on };
      player.loop.on = false;
      player.seek(from);
      player.play();
      figure.clock = () => {
        if (player.time >= Math.min(player.durationS - 0.05, from + figure.durationS)) player.seek(from);
        return Math.max(0, player.time - from);
      };
      this.figures.wake();
    };
    const end = () => {
      if (was) player.loop.on = was.looping;
      was = figure.clock = null;
    };
    const stop = () => {
      if (!was) return;
      if (!was.playing) player.pause();
      player.seek(was.time);
      end();
    };
    // Not `pointerenter`, which also comes when new figures appear under a pointer at rest.
    button.addEventListener("pointermove", ({ movementX, movementY, pointerType }) => {
      if (pointerType !== "touch" && (movementX || movementY)) start();
    });
    button.addEventListener("focus", () => { if (button.matches(":focus-visible")) start(); });
    for (const name of ["pointerleave", "blur"]) button.addEventListener(name, stop);
    button.end = end;
  }

  async #choose(alternative, button) {
    button.end?.(); // what is chosen is played from its start
    button.setAttribute("aria-busy", "true");
    await this.actions.choose(alternative);
    button.removeAttribute("aria-busy");
  }
}
