// The selected span: dragged on the timeline or set by keys, with its ends on counts.

import { Gestures } from "/page/gestures.js";
import { clamp } from "/page/math.js";
import { SEAM_ROWS } from "./lanes.js";
import { clockText } from "/page/timeline.js";

const CLICK_PX = 4; // a shorter drag is a click, which seeks
const SHORTEST_S = 0.3;
const RULER_PX = 16; // dragging the ruler seeks

export class Selection {
  constructor(store, getCounts) {
    Object.assign(this, { store, getCounts, snaps: true, dragging: false });
  }

  // The count nearest to a time, or the time itself.
  snap(timeS, { free = false } = {}) {
    const { dance } = this.store;
    const times = dance.music_beats_s;
    if (free || !this.snaps || !times.length) return timeS;
    const ends = [0, ...times, dance.duration_s];
    return ends.reduce((best, time) => (Math.abs(time - timeS) < Math.abs(best - timeS) ? time : best));
  }

  // The count nearest to a time, whether or not spans snap to counts.
  snapToCount(timeS) {
    const { snaps } = this;
    this.snaps = true;
    const found = this.snap(timeS);
    this.snaps = snaps;
    return found;
  }

  // The count before or after a time.
  neighbour(timeS, sign) {
    const { dance } = this.store;
    const ends = [0, ...dance.music_beats_s, dance.duration_s];
    const found = sign > 0 ? ends.find((time) => time > timeS + 0.01) : ends.findLast((time) => time < timeS - 0.01);
    return clamp(found ?? timeS, 0, dance.duration_s);
  }

  // How many counts lie from one time to another, below 0 if it is earlier.
  countsFrom(timeS, toS) {
    const { dance } = this.store, ends = [0, ...dance.music_beats_s, dance.duration_s];
    const nearest = (time) => ends.reduce((best, end, i) => (Math.abs(end - time) < Math.abs(ends[best] - time) ? i : best), 0);
    return nearest(toS) - nearest(timeS);
  }

  // The join nearest to a time, or null if the dance has none.
  joinAt(timeS) {
    const { joins = [] } = this.store.dance;
    return joins.reduce((best, join) => (best === null || Math.abs(join - timeS) < Math.abs(best - timeS) ? join : best), null);
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

// Gestures of the studio's timeline: a drag over the lanes selects, one of a join's handle moves the join, a click seeks,
// and a drag on the ruler seeks along.
export function selectingGestures(selection, moveSeam) {
  return class SelectingGestures extends Gestures {
    constructor(timeline) {
      super(timeline);
      timeline.element.addEventListener("dblclick", (event) => this.#select(event));
      timeline.element.addEventListener("pointerup", () => this.#finish());
      timeline.element.addEventListener("pointercancel", () => { this.seam = null; timeline.showSeam(null); });
      timeline.element.addEventListener("pointermove", (event) => {
        const over = this.seam || this.#joinUnder(event.offsetX, event) !== null;
        timeline.element.style.cursor = over ? "ew-resize" : "";
      });
    }

    begin(x, event) {
      const { timeline } = this;
      if (event.offsetY < RULER_PX && !event.shiftKey) return this.scrub(x);
      const { span } = selection.store, grip = event.pointerType === "touch" ? 16 : 6;
      const join = event.shiftKey ? null : this.#joinUnder(x, event);
      if (join !== null) {
        this.seam = { at: join, counts: 0 };
        return (x2) => {
          this.seam.counts = selection.countsFrom(join, timeline.timeAt(x2));
          timeline.showSeam(this.seam.counts ? selection.snapToCount(timeline.timeAt(x2)) : join);
        };
      }
      let still = timeline.timeAt(x);
      if (event.shiftKey && span) still = Math.abs(still - span.from) > Math.abs(still - span.to) ? span.from : span.to;
      else if (span && Math.abs(x - timeline.x(span.from)) < grip) still = span.to;
      else if (span && Math.abs(x - timeline.x(span.to)) < grip) still = span.from;
      this.click = { x, moved: event.shiftKey };
      return (x2) => {
        if (Math.abs(x2 - x) > CLICK_PX) this.click.moved = true;
        selection.dragging = this.click.moved; // the card of a block would cover the dance
        if (this.click.moved) selection.set(still, timeline.timeAt(x2), { free: event.altKey });
      };
    }

    // The join whose handle is under a pointer, or null.
    #joinUnder(x, { offsetY, pointerType, target }) {
      const { timeline } = this;
      if (target !== timeline.element && !timeline.element.contains(target)) return null;
      if (!selection.store.has("seam") || offsetY < SEAM_ROWS[0] || offsetY > SEAM_ROWS[1]) return null;
      const join = selection.joinAt(timeline.timeAt(x));
      return join !== null && Math.abs(timeline.x(join) - x) < (pointerType === "touch" ? 12 : 5) ? join : null;
    }

    #finish() {
      const { click, seam, timeline } = this;
      this.seam = null;
      selection.dragging = false;
      timeline.showSeam(null);
      if (seam) { if (seam.counts) moveSeam(seam.at, seam.counts); return; }
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
