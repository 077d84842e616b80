// The selected span: dragged on the timeline or set by keys, with its ends on counts.

import { Gestures } from "/page/gestures.js";
import { clamp } from "/page/math.js";
import { clockText } from "/page/timeline.js";

const CLICK_PX = 4; // a shorter drag is a click, which seeks
const SHORTEST_S = 0.3;
const RULER_PX = 16; // dragging the ruler seeks

export class Selection {
  constructor(store, getCounts) {
    Object.assign(this, { store, getCounts, snaps: true });
  }

  // The count nearest to a time, or the time itself.
  snap(timeS, { free = false } = {}) {
    const { dance } = this.store;
    const times = dance.music_beats_s;
    if (free || !this.snaps || !times.length) return timeS;
    const ends = [0, ...times, dance.duration_s];
    return ends.reduce((best, time) => (Math.abs(time - timeS) < Math.abs(best - timeS) ? time : best));
  }

  // The count before or after a time.
  neighbour(timeS, sign) {
    const { dance } = this.store;
    const ends = [0, ...dance.music_beats_s, dance.duration_s];
    const found = sign > 0 ? ends.find((time) => time > timeS + 0.01) : ends.findLast((time) => time < timeS - 0.01);
    return clamp(found ?? timeS, 0, dance.duration_s);
  }

  set(a, b, options) {
    const [from, to] = [Math.min(a, b), Math.max(a, b)].map((time) => this.snap(time, options));
    if (to - from < SHORTEST_S) return;
    this.store.select({ from, to });
  }

  clear() { this.store.select(null); }

  // The block, section or bar around a time.
  around(timeS, pieces) {
    const piece = pieces.find(({ start_s, end_s }) => timeS >= start_s && timeS < end_s);
    if (piece) this.set(piece.start_s, piece.end_s);
  }

  // "0:12.0 to 0:16.0, bars 7 to 8, 4.0 s"
  text() {
    const { span } = this.store;
    if (!span) return "";
    const counts = this.getCounts();
    const [first, last] = [counts.at(span.from + 0.05), counts.at(span.to - 0.05)];
    const bars = first && last ? (first.bar === last.bar ? `bar ${first.bar}` : `bars ${first.bar} to ${last.bar}`) : "";
    return [`${clockText(span.from, true)} to ${clockText(span.to, true)}`, bars, `${(span.to - span.from).toFixed(1)} s`]
      .filter(Boolean).join(" · ");
  }
}

// Gestures of the studio's timeline: a drag over the lanes selects, a click seeks, a drag on the ruler seeks along.
export function selectingGestures(selection) {
  return class SelectingGestures extends Gestures {
    constructor(timeline) {
      super(timeline);
      timeline.element.addEventListener("dblclick", (event) => this.#select(event));
      timeline.element.addEventListener("pointerup", () => this.#finish());
    }

    begin(x, event) {
      const { timeline } = this;
      if (event.offsetY < RULER_PX && !event.shiftKey) return this.scrub(x);
      const { span } = selection.store, grip = event.pointerType === "touch" ? 16 : 6;
      let still = timeline.timeAt(x);
      if (event.shiftKey && span) still = Math.abs(still - span.from) > Math.abs(still - span.to) ? span.from : span.to;
      else if (span && Math.abs(x - timeline.x(span.from)) < grip) still = span.to;
      else if (span && Math.abs(x - timeline.x(span.to)) < grip) still = span.from;
      this.click = { x, moved: event.shiftKey };
      return (x2) => {
        if (Math.abs(x2 - x) > CLICK_PX) this.click.moved = true;
        if (this.click.moved) selection.set(still, timeline.timeAt(x2), { free: event.altKey });
      };
    }

    #finish() {
      const { click, timeline } = this;
      this.click = null;
      if (click && !click.moved) timeline.player.seek(timeline.timeAt(click.x));
      else if (click) selection.store.dispatchEvent(new Event("spanend"));
    }

    #select(event) {
      const { timeline } = this;
      const time = timeline.timeAt(event.clientX - timeline.element.getBoundingClientRect().left);
      selection.around(time, timeline.piecesAt(event.offsetY));
      selection.store.dispatchEvent(new Event("spanend"));
    }
  };
}
