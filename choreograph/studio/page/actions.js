// What can be done with the dance: edits of the selected span, locks, undo and redo.

import { post } from "./api.js";
import { attempt, say } from "./messages.js";

const LABELS = {
  swap: "Looking for something else", vary: "Varying", repeat: "Repeating", pin_take: "Placing the take",
  pin_motif: "Placing the motif", ban: "Leaving out the take", hold: "Holding the pose",
  cut: "Cutting to the section",
};

const EDITS = ["swap", "vary", "repeat", "pin_take", "pin_motif"]; // of any server

export class Actions {
  constructor(store, jobs, getPlayer) {
    Object.assign(this, { store, jobs, getPlayer, tries: 0 });
  }

  canEdit(kind) { return this.store.has("edit") && (this.store.state?.choices.edits ?? EDITS).includes(kind); }

  // Edit the selected span, or what is given, and play the result from its start.
  async edit(kind, more = {}) {
    const span = more.from === undefined ? this.store.span : { from: more.from, to: more.to };
    if (!span) { say("Select a span first: drag over the timeline, or press [ and ] at its ends."); return null; }
    this.tries += 1;
    return attempt(async () => {
      const answer = await this.store.change("edit", { kind, ...span, seed: this.tries, ...more });
      await this.jobs.finish(answer, LABELS[kind]);
      this.playFrom(span.from);
      return true;
    });
  }

  // Play again from a little before a time, if anything is playing or has been.
  playFrom(timeS) {
    const player = this.getPlayer();
    player.seek(Math.max(0, timeS - 0.5));
    player.play();
  }

  // Dance an alternative. Until it is there, what comes before it is played, which is the same in both dances.
  choose(alternative) {
    return attempt(async () => {
      this.playFrom(alternative.start_s);
      await this.store.change("choose", { id: alternative.id });
      if (this.getPlayer().time > alternative.start_s) this.playFrom(alternative.start_s);
      say("Changed. Undo with Ctrl+Z.");
    });
  }

  get spanIsLocked() {
    const { span, state } = this.store;
    return Boolean(span && state?.locks.some(([from, to]) => from <= span.from + 0.02 && to >= span.to - 0.02));
  }

  // Lock the selected span, or unlock it.
  toggleLock() {
    const { span, state } = this.store;
    if (!span) { say("Select a span to lock: drag over the timeline."); return null; }
    const { from, to } = span;
    const locks = this.spanIsLocked
      ? state.locks.flatMap((lock) => without(lock, from, to))
      : joined([...state.locks, [from, to]]);
    return attempt(() => this.store.change("locks", { locks }));
  }

  undo() { return this.#step("undo", "can_undo", "There is nothing to undo."); }
  redo() { return this.#step("redo", "can_redo", "There is nothing to redo."); }

  #step(path, able, otherwise) {
    if (!this.store.state?.[able]) { say(otherwise); return null; }
    return attempt(() => this.store.change(path));
  }

  // Make the dance again with other settings, or one span of it. Locked spans are kept. What is danced from the
  // playhead on comes first.
  settings(changes, span = null, label = "Dancing again") {
    return attempt(async () => {
      const at = this.getPlayer().time;
      const answer = await this.store.change("settings", { changes, keep_locked: true, at, ...span });
      await this.jobs.finish(answer, label, { onFirst: (part) => this.store.tellFirst(part) });
      return true;
    });
  }

  // Move the join at a time by counts, later or, below 0, earlier, and play over it.
  moveSeam(at, counts) {
    if (!counts) return null;
    return attempt(async () => {
      await this.jobs.finish(await this.store.change("seam", { at, counts }), "Moving the join");
      this.playFrom(Math.max(0, at - 1));
    });
  }

  // Move the join that is nearest to a time by counts.
  moveSeamNear(timeS, counts) {
    const { joins = [] } = this.store.dance;
    if (!joins.length) { say("One take is danced without joins."); return null; }
    return this.moveSeam(joins.reduce((best, join) => (Math.abs(join - timeS) < Math.abs(best - timeS) ? join : best)), counts);
  }

  rate(better) { return attempt(() => post("rating", { better })); }
}

// What is left of a lock outside of a span.
function without([start, end], from, to) {
  return [[start, Math.min(end, from)], [Math.max(start, to), end]].filter(([a, b]) => b - a > 0.05);
}

// Spans in order, those that touch as one.
function joined(spans) {
  const sorted = spans.map((span) => [...span]).sort((a, b) => a[0] - b[0]), out = [];
  for (const span of sorted) {
    const last = out.at(-1);
    if (last && span[0] <= last[1] + 0.02) last[1] = Math.max(last[1], span[1]);
    else out.push(span);
  }
  return out;
}
