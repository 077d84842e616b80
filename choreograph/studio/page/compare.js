// Two versions of the dance: A and B, side by side or flipped in time with the music, with what differs marked, and a
// rating of which one is better.

import { get, post } from "./api.js";
import { DancerView } from "./dancer_view.js";
import { attempt, say } from "./messages.js";

const SAME_S = 0.05;

export class Compare {
  constructor(store, actions, view, lanes, player) {
    Object.assign(this, { store, actions, view, lanes, player, showing: null, facts: {}, second: null });
    const on = (id, act) => document.getElementById(id).addEventListener("click", act);
    for (const slot of ["A", "B"]) {
      on(`keep-${slot}`, () => this.keep(slot));
      on(`show-${slot}`, () => this.show(slot));
      on(`better-${slot}`, () => this.rate(slot));
    }
    on("show-both", () => this.show("both"));
    on("show-current", () => this.show(null));
    on("better-same", () => this.rate("same"));
    store.addEventListener("state", ({ detail }) => this.#showButtons(detail.before));
    this.#showButtons();
  }

  get ready() { return Boolean(this.store.state?.versions.A && this.store.state?.versions.B); }

  // The dance as it is becomes version A or B.
  keep(slot) {
    return attempt(async () => {
      this.store.apply(await this.store.sending(post("versions", { slot })));
      delete this.facts[slot];
      say(`This dance is version ${slot} now.`);
    });
  }

  // Show A, B, both side by side, or null for the dance as it is. The music goes on.
  show(which) {
    return attempt(async () => {
      if (which && !this.ready) { say("Keep two versions first, A and B."); return; }
      this.showing = which;
      const { state } = this.store;
      document.body.classList.toggle("both", which === "both");
      if (which === null) await this.view.show(state);
      else {
        const facts = await this.#versions();
        const first = which === "B" ? "B" : "A";
        await this.view.show(state, { dance: facts[first], motionPath: `versions/${first}/motion` });
        if (which === "both") await this.#showSecond(state, facts.B);
        this.lanes.differences = differences(facts.A, facts.B);
      }
      if (which === null) this.lanes.differences = null;
      if (which !== "both" && this.second) { this.second.stage.player = null; }
      this.lanes.redraw();
      this.#showButtons();
    });
  }

  // From A to B and back, for the keyboard.
  flip() { return this.show(this.showing === "A" ? "B" : "A"); }

  rate(better) {
    return attempt(async () => {
      const saved = await this.actions.rate(better);
      if (saved) say(`Saved in ${saved.file}.`);
    });
  }

  async #versions() {
    for (const slot of ["A", "B"]) this.facts[slot] ??= await get(`versions/${slot}/facts`);
    return this.facts;
  }

  // The second dancer has the same clock and the same view.
  async #showSecond(state, dance) {
    this.second ??= new DancerView(document.getElementById("second"), this.player, () => {});
    await this.second.show(state, { dance, motionPath: "versions/B/motion" });
    this.second.stage.player = this.player;
    this.second.stage.camera = this.view.camera;
    const { camera } = this.view.stage;
    const own = Object.create(camera); // looks at its own dancer from the first one's direction
    own.look(this.second.stage.dancer);
    this.second.stage.camera = own;
    this.second.wake();
  }

  #showButtons(before) {
    const { state } = this.store;
    if (before && this.showing && before.revision !== state.revision) { this.show(null); return; }
    const { versions } = state;
    for (const slot of ["A", "B"]) {
      document.getElementById(`kept-${slot}`).textContent = versions[slot] ? `dance ${versions[slot]} of this project` : "not kept yet";
      document.getElementById(`show-${slot}`).setAttribute("aria-pressed", String(this.showing === slot));
    }
    document.getElementById("show-both").setAttribute("aria-pressed", String(this.showing === "both"));
    document.getElementById("show-current").setAttribute("aria-pressed", String(this.showing === null));
    for (const control of document.querySelectorAll("[data-needs-versions]")) control.disabled = !this.ready;
    for (const slot of ["A", "B"]) document.getElementById(`keep-${slot}`).disabled = !state.dance;
    document.getElementById("version-labels").hidden = this.showing !== "both";
  }
}

// Spans in which two dances differ: other takes, or other times of them.
function differences(a, b) {
  const key = ({ blocks }, timeS) => {
    const block = blocks.findLast(({ start_s }) => start_s <= timeS + 1e-6) ?? blocks[0];
    return [block.take, block.from_s === undefined ? 0 : block.from_s + (timeS - block.start_s) * (block.speed ?? 1), block.mirrored ?? false];
  };
  const names = (dance, take) => dance.takes[take].name;
  const spans = [];
  const end = Math.min(a.duration_s, b.duration_s);
  for (let t = 0; t < end; t += 0.1) {
    const [one, other] = [key(a, t), key(b, t)];
    if (names(a, one[0]) === names(b, other[0]) && Math.abs(one[1] - other[1]) < SAME_S && one[2] === other[2]) continue;
    const last = spans.at(-1);
    if (last && t - last[1] < 0.15) last[1] = t + 0.1; else spans.push([t, t + 0.1]);
  }
  return spans;
}
