// The buttons that act on the selected span, and the line that says which span it is.

import { clockText } from "/page/timeline.js";

const $ = (id) => document.getElementById(id);

export class SpanTools {
  constructor(store, selection, actions, player) {
    Object.assign(this, { store, selection, actions, player });
    const on = (id, act) => $(id).addEventListener("click", act);
    on("swap", () => actions.edit("swap"));
    on("vary", () => actions.edit("vary"));
    on("repeat", () => actions.edit("repeat", { at: selection.snap(player.time) }));
    on("repeat-mirrored", () => actions.edit("repeat", { at: selection.snap(player.time), mirrored: true }));
    on("hold", () => actions.edit("hold"));
    on("cut", () => actions.edit("cut", { section: Number($("cut-to").value) }));
    on("seam-earlier", () => actions.moveSeamNear(player.time, -1));
    on("seam-later", () => actions.moveSeamNear(player.time, 1));
    on("lock", () => actions.toggleLock());
    on("loop-span", () => { player.setLoop(store.span.from, store.span.to); player.seek(store.span.from); player.play(); });
    on("clear-span", () => selection.clear());
    on("section-span", () => this.#selectHere(store.dance.sections ?? []));
    store.addEventListener("span", () => this.show());
    store.addEventListener("state", () => this.show());
    this.show();
  }

  // Select the section at the playhead.
  #selectHere(pieces) {
    this.selection.around(this.player.time, pieces);
    this.store.dispatchEvent(new Event("spanend"));
  }

  // The sections whose dance a span can have.
  #showSections(sections) {
    const names = namesOf(sections), key = names.join();
    $("cut-row").hidden = !this.store.span || names.length < 2 || !this.actions.canEdit("cut");
    if (key === this.sections) return;
    this.sections = key;
    $("cut-to").replaceChildren(...names.map((name, i) => new Option(name, i)));
  }

  show() {
    const { store, actions } = this, { span } = store;
    $("span-text").textContent = span ? this.selection.text() : "Drag over the timeline to select a span.";
    $("span-tools").hidden = !span;
    $("span-help").hidden = Boolean(span);
    $("clear-span").hidden = !span;
    $("section-span").hidden = !(store.dance?.sections ?? []).length;
    $("seam-row").hidden = Boolean(span) || !store.has("seam") || !store.dance?.joins?.length; // room for alternatives
    this.#showSections(store.dance?.sections ?? []);
    if (!span) return;
    for (const kind of ["swap", "vary", "repeat", "hold"]) $(kind).hidden = !actions.canEdit(kind);
    $("repeat-mirrored").hidden = !actions.canEdit("repeat");
    const locked = actions.spanIsLocked;
    $("lock").setAttribute("aria-pressed", String(locked));
    $("lock-label").textContent = locked ? "Unlock" : "Lock";
    for (const id of ["swap", "vary", "hold", "cut"]) $(id).disabled = locked;
  }
}

// "A, 0:00", "B, 0:16", "A, 0:32"
function namesOf(sections) { return sections.map(({ name, start_s: startS }) => `${name}, ${clockText(startS, false)}`); }
