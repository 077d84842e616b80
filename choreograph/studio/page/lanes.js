// The timeline of the studio: the dance page's, with sections, names of takes and figures, locks, changed spans and
// the selected span.

import { Timeline } from "/page/timeline.js";

const BLOCKS = [86, 120], NAMES = [123, 138], SECTIONS = [143, 159]; // rows, in pixels from the top
export const SEAM_ROWS = [82, 124]; // in which the handles of joins can be dragged
const SHORTEST_NAME_PX = 26;
const CONTIGUOUS_S = 0.02;

export class Lanes extends Timeline {
  constructor(store, dance, levels, counts, player, options) {
    super(dance, levels, counts, player, options);
    this.store = store;
    this.runs = runsOf(dance);
    this.differences = null; // spans in which compared versions differ
    this.chosen = document.getElementById("chosen");
    this.seam = document.getElementById("seam");
  }

  // Show another dance of the same page.
  open(dance, levels, counts) {
    const other = dance.duration_s !== this.durationS;
    Object.assign(this, { dance, levels, counts, runs: runsOf(dance), durationS: dance.duration_s });
    this.element.setAttribute("aria-valuemax", this.durationS.toFixed(2));
    if (other) this.showAll();
  }

  // What a double-click selects at a height: a section, or what is danced without a join.
  piecesAt(y) { return y >= SECTIONS[0] ? this.dance.sections ?? [] : this.runs; }

  redraw() {
    super.redraw();
    this.showSpan();
  }

  showSpan() {
    const span = this.store?.span;
    this.chosen.hidden = !span;
    if (!span) return;
    this.chosen.style.transform = `translateX(${this.x(span.from)}px)`;
    this.chosen.style.width = `${(span.to - span.from) * this.pxPerS}px`;
  }

  // Where the join that is dragged would be, or nowhere for null.
  showSeam(timeS) {
    this.seam.hidden = timeS === null;
    if (timeS !== null) this.seam.style.transform = `translateX(${this.x(timeS)}px)`;
  }

  drawMore(context) {
    if (!this.store) return;
    if (this.store.has("seam")) this.#drawJoins(context);
    this.#drawNames(context);
    this.#drawSections(context);
    this.#drawChanged(context);
    this.#drawLocks(context);
  }

  #drawNames(context) {
    context.font = "10.5px system-ui, sans-serif";
    context.fillStyle = this.ink("--soft");
    for (const run of this.runs) {
      const x = Math.max(2, this.x(run.start_s)), room = Math.min(this.x(run.end_s), this.width) - x - 6;
      if (room < SHORTEST_NAME_PX) continue;
      context.fillText(shortened(context, run.name, room), x + 1, NAMES[1] - 4);
    }
  }

  // The handle of each join, where one take gives way to the next.
  #drawJoins(context) {
    const [top, bottom] = BLOCKS;
    for (const join of this.dance.joins ?? []) {
      const x = this.x(join);
      if (x < -4 || x > this.width + 4) continue;
      context.fillStyle = this.ink("--panel");
      context.beginPath();
      context.roundRect(x - 3.5, top + 6, 7, bottom - top - 12, 3.5);
      context.fill();
      context.fillStyle = this.ink("--ink");
      context.beginPath();
      context.roundRect(x - 1.5, top + 8, 3, bottom - top - 16, 1.5);
      context.fill();
    }
  }

  #drawSections(context) {
    const [top, bottom] = SECTIONS;
    context.font = "600 10.5px system-ui, sans-serif";
    for (const { name, start_s, end_s } of this.dance.sections ?? []) {
      const x = this.x(start_s), width = (end_s - start_s) * this.pxPerS - 2;
      if (x > this.width || x + width < 0) continue;
      context.fillStyle = this.ink("--raised");
      context.beginPath();
      context.roundRect(x, top, Math.max(1, width), bottom - top, 4);
      context.fill();
      context.fillStyle = this.ink("--soft");
      const left = Math.max(x, 0) + 6, room = x + width - left - 4;
      if (room > 10) context.fillText(shortened(context, name, room), left, bottom - 4.5);
    }
  }

  // A line over what the last change has changed, or over what two compared versions differ in.
  #drawChanged(context) {
    context.fillStyle = this.ink("--accent");
    for (const [from, to] of this.differences ?? this.store.state?.changed ?? []) {
      context.fillRect(this.x(from), BLOCKS[0] - 4, Math.max(2, (to - from) * this.pxPerS), 2);
    }
  }

  #drawLocks(context) {
    const [top, bottom] = BLOCKS;
    for (const [from, to] of this.store.state?.locks ?? []) {
      const x = this.x(from), width = (to - from) * this.pxPerS;
      context.save();
      context.beginPath();
      context.rect(x, top, width, bottom - top);
      context.clip();
      context.strokeStyle = "rgb(0 0 0 / 0.34)";
      context.lineWidth = 2;
      context.beginPath();
      for (let at = -(bottom - top); at < width; at += 8) {
        context.moveTo(x + at, bottom);
        context.lineTo(x + at + (bottom - top), top);
      }
      context.stroke();
      context.restore();
      drawPadlock(context, x + 5, top + 4);
    }
  }
}

// Contiguous blocks of one take and figure, with a name.
function runsOf(dance) {
  const runs = [];
  for (const block of dance.blocks) {
    const last = runs.at(-1);
    const goes = last && last.take === block.take && Math.abs((last.to_s ?? NaN) - (block.from_s ?? NaN)) < CONTIGUOUS_S;
    if (goes && (block.figure ?? "") === last.figure) Object.assign(last, { end_s: block.end_s, to_s: block.to_s });
    else runs.push({ ...block, figure: block.figure ?? "", name: block.figure || dance.takes[block.take].name });
  }
  return runs;
}

function shortened(context, text, room) {
  if (context.measureText(text).width <= room) return text;
  let end = text.length;
  while (end > 1 && context.measureText(`${text.slice(0, end)}…`).width > room) end--;
  return `${text.slice(0, end)}…`;
}

function drawPadlock(context, x, y) {
  context.fillStyle = context.strokeStyle = "rgb(0 0 0 / 0.78)";
  context.lineWidth = 1.6;
  context.beginPath();
  context.roundRect(x, y + 5, 10, 7.5, 1.6);
  context.fill();
  context.beginPath();
  context.arc(x + 5, y + 5, 3, Math.PI, 0);
  context.stroke();
}
