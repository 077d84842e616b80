// The keys of the studio, beside those of the player, so that everything can be done without a pointer.

export class Keyboard {
  // parts: { store, selection, actions, tabs, lanes, player, compare, alternatives }
  constructor(parts) {
    Object.assign(this, parts);
    addEventListener("keydown", (event) => this.#key(event), { capture: true });
  }

  #key(event) {
    const typing = event.target.closest?.("input:not([type=range]):not([type=radio]):not([type=checkbox]), select, textarea, dialog");
    if (typing || document.getElementById("keys").open) return;
    const act = event.ctrlKey || event.metaKey ? this.#commands(event) : event.altKey ? null : this.#keys(event);
    if (!act || !this.store.state) return;
    event.preventDefault();
    act();
  }

  #commands(event) {
    const key = event.key.toLowerCase();
    if (key === "z") return event.shiftKey ? () => this.actions.redo() : () => this.actions.undo();
    if (key === "y") return () => this.actions.redo();
    if (key === "e") return () => this.tabs.open("export", { focus: true });
    return null;
  }

  #keys(event) {
    const { store, selection, actions, tabs, lanes, player } = this, { span } = store;
    const inFigures = event.target.closest?.(".figures");
    if (inFigures && event.key.startsWith("Arrow")) return () => this.#walkFigures(event);
    if (!store.dance) return null;
    const number = Number(event.key);
    if (number >= 1 && number <= tabs.tabs.length) return () => tabs.open(tabs.tabs[number - 1].dataset.panel, { focus: true });
    const ends = (from, to) => { selection.set(from, to); store.dispatchEvent(new Event("spanend")); };
    return {
      "[": () => ends(player.time, span && span.to > player.time ? span.to : Math.min(player.durationS, player.time + 4)),
      "]": () => ends(span && span.from < player.time ? span.from : Math.max(0, player.time - 4), player.time),
      ",": () => player.seek(selection.neighbour(player.time, -1)),
      ".": () => player.seek(selection.neighbour(player.time, 1)),
      e: () => { selection.around(player.time, lanes.runs); store.dispatchEvent(new Event("spanend")); },
      E: () => { selection.around(player.time, store.dance.sections ?? []); store.dispatchEvent(new Event("spanend")); },
      l: () => this.loop(),
      a: () => this.#focusFigures(),
      x: () => actions.edit("swap"),
      v: () => actions.edit("vary"),
      r: () => actions.edit("repeat", { at: selection.snap(player.time) }),
      R: () => actions.edit("repeat", { at: selection.snap(player.time), mirrored: true }),
      h: () => actions.canEdit("hold") && actions.edit("hold"),
      k: () => actions.toggleLock(),
      "<": () => this.moveSeam(-1),
      ">": () => this.moveSeam(1),
      j: () => this.#toJoin(1),
      J: () => this.#toJoin(-1),
      c: () => this.compare.flip(),
      n: () => document.getElementById("roll").click(),
      Escape: () => selection.clear(),
    }[event.key] ?? null;
  }

  // Move the join at the playhead by counts.
  moveSeam(counts) { return this.actions.moveSeamNear(this.player.time, counts); }

  // Go to the next join, or the one before.
  #toJoin(sign) {
    const { player } = this, { joins = [] } = this.store.dance;
    const found = sign > 0 ? joins.find((join) => join > player.time + 0.02) : joins.findLast((join) => join < player.time - 0.02);
    if (found !== undefined) player.seek(found);
  }

  // Loop the selected span, or stop looping.
  loop() {
    const { player } = this, { span } = this.store;
    if (player.loop.on || !span) player.setLooping(!player.loop.on);
    else { player.setLoop(span.from, span.to); player.seek(span.from); }
  }

  #focusFigures() {
    this.tabs.open("change");
    document.querySelector("#alternatives button")?.focus();
  }

  #walkFigures(event) {
    const all = [...event.target.closest(".figures").querySelectorAll("button.figure")];
    const step = { ArrowRight: 1, ArrowLeft: -1, ArrowDown: 2, ArrowUp: -2 }[event.key];
    all[Math.min(all.length - 1, Math.max(0, all.indexOf(event.target.closest("button")) + step))]?.focus();
  }
}
