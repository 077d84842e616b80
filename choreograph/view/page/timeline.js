// The song, and the take of each second. Static layers are drawn when the view changes, not every frame.

import { Gestures } from "./gestures.js";
import { clamp } from "./math.js";

const RULER = 15, WAVE = [17, 60], BEATS = [64, 80], BLOCKS = [86, 120]; // rows, in pixels from the top
const ROOMY_PX_PER_S = 20; // at least this much: longer songs are shown in part
const MAX_PX_PER_S = 400;
const LABELS_APART_S = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600];
const NUMBER_PX = 13, BAR_NUMBER_PX = 34, BAR_LINE_PX = 5; // room that a count, a bar's number or its line needs
const PAGE_AT = 0.08; // of the width: position of the playhead after the view has jumped

export class Timeline {
  // gestures: what pointers do here.
  constructor(dance, levels, counts, player, { onHover, gestures = Gestures }) {
    Object.assign(this, { dance, levels, counts, player, onHover });
    this.durationS = dance.duration_s;
    this.element = document.getElementById("timeline");
    this.tracks = document.getElementById("tracks");
    this.overview = document.getElementById("overview");
    this.playhead = document.getElementById("playhead");
    this.pointer = document.getElementById("pointer");
    this.range = document.getElementById("range");
    this.fromS = 0;
    this.zoom = null; // pixels per second, null for the default
    this.wasInside = true;
    this.element.setAttribute("aria-valuemax", this.durationS.toFixed(2));
    new gestures(this);
  }

  get width() { return this.element.clientWidth; }
  get pxPerS() { return Math.max(this.zoom ?? ROOMY_PX_PER_S, this.width / this.durationS); }
  get shownS() { return this.width / this.pxPerS; }
  x(timeS) { return (timeS - this.fromS) * this.pxPerS; }
  timeAt(x) { return clamp(this.fromS + x / this.pxPerS, 0, this.durationS); }

  recolour(colours) { this.colours = colours; this.redraw(); }

  // Zoom by a factor. The time at x stays in place.
  zoomBy(factor, x = this.width / 2) {
    const still = this.timeAt(x);
    this.zoom = clamp(this.pxPerS * factor, this.width / this.durationS, MAX_PX_PER_S);
    this.pan(still - x / this.pxPerS - this.fromS);
  }

  showAll() { this.zoom = 0; this.pan(0); }

  pan(seconds) {
    this.fromS = clamp(this.fromS + seconds, 0, Math.max(0, this.durationS - this.shownS));
    this.wasInside = this.#inside(this.player.time);
    this.redraw();
  }

  #inside(timeS) { return timeS >= this.fromS && timeS <= this.fromS + this.shownS; }

  // Move the playhead, and jump to the next part when it leaves the view.
  show(timeS) {
    if (!this.#inside(timeS) && this.wasInside) {
      this.fromS = clamp(timeS - PAGE_AT * this.shownS, 0, Math.max(0, this.durationS - this.shownS));
      this.redraw();
    }
    this.wasInside = this.#inside(timeS);
    moveTo(this.playhead, this.x(timeS));
    this.#showOverviewHead(timeS);
  }

  showLoop({ on, from, to }) {
    this.range.hidden = !on;
    this.range.style.transform = `translateX(${this.x(from)}px)`;
    this.range.style.width = `${(to - from) * this.pxPerS}px`;
  }

  redraw() {
    if (!this.colours || !this.width) return;
    const context = fitted(this.tracks, this.width, this.element.clientHeight);
    const style = getComputedStyle(document.documentElement);
    this.ink = (name) => style.getPropertyValue(name);
    this.#drawRuler(context);
    this.#drawBeatLines(context);
    this.#drawWave(context);
    this.#drawBars(context);
    this.#drawBeats(context);
    this.#drawBlocks(context, this.fromS, this.pxPerS, BLOCKS, 4);
    this.drawMore(context);
    this.#drawOverview();
    this.showLoop(this.player.loop);
    this.show(this.player.time);
  }

  drawMore() {} // for more rows in other pages

  #drawRuler(context) {
    const apart = LABELS_APART_S.find((s) => s * this.pxPerS >= 62) ?? 1200;
    context.fillStyle = this.ink("--faint");
    context.font = "10.5px system-ui, sans-serif";
    for (let i = Math.ceil(this.fromS / apart); i * apart < this.fromS + this.shownS; i++) {
      const label = clockText(i * apart, apart < 1);
      const x = this.x(i * apart);
      const left = clamp(x - context.measureText(label).width / 2, 0, this.width);
      if (x < this.width - 16) context.fillText(label, left, 10);
    }
  }

  #between(times) {
    const end = this.fromS + this.shownS;
    return times.filter((time) => time >= this.fromS - 0.1 && time <= end + 0.1);
  }

  #drawBeatLines(context) {
    const beats = this.#between(this.dance.music_beats_s);
    if (this.width / Math.max(1, beats.length) < 5) return;
    context.fillStyle = this.ink("--beat");
    for (const beat of beats) context.fillRect(Math.round(this.x(beat) * 2) / 2 - 0.5, RULER, 1, BLOCKS[1] - RULER);
  }

  #drawWave(context) {
    const { peaks, cores } = this.levels;
    const [top, bottom] = WAVE, middle = (top + bottom) / 2, half = (bottom - top) / 2;
    const bar = 2, gap = 1;
    for (const [levels, colour] of [[peaks, this.ink("--wave")], [cores, this.ink("--wave-core")]]) {
      context.fillStyle = colour;
      for (let x = 0; x < this.width; x += bar + gap) {
        const from = Math.floor((this.fromS + x / this.pxPerS) * this.dance.levels_per_s);
        const to = Math.max(from + 1, from + Math.ceil(((bar + gap) / this.pxPerS) * this.dance.levels_per_s));
        let level = 0;
        for (let i = from; i < to && i < levels.length; i++) level = Math.max(level, levels[i]);
        const high = Math.max(0.5, (level / 255) * half);
        context.fillRect(x, middle - high, bar, 2 * high);
      }
    }
  }

  // A line at every downbeat, with the bar's number where there is room.
  #drawBars(context) {
    const { times, numbers, bars } = this.counts;
    const apart = (this.durationS * this.pxPerS) / Math.max(1, bars.at(-1) ?? 0);
    if (apart < BAR_LINE_PX) return;
    context.font = "10px system-ui, sans-serif";
    for (let i = 0; i < numbers.length; i++) {
      const x = Math.round(this.x(times[i]) * 2) / 2;
      if (numbers[i] !== 1 || x < -BAR_NUMBER_PX || x > this.width) continue;
      context.fillStyle = this.ink("--bar");
      context.fillRect(x - 0.5, RULER, 1, BLOCKS[1] - RULER);
      context.fillStyle = this.ink("--soft");
      if (apart >= BAR_NUMBER_PX) context.fillText(bars[i], x + 3, RULER + 9);
    }
  }

  // The number of every count in place of its tick, or false if there is no room for them.
  #drawNumbers(context, top) {
    const { times, numbers } = this.counts;
    if (!numbers.length || (this.durationS * this.pxPerS) / numbers.length < NUMBER_PX) return false;
    for (let i = 0; i < numbers.length; i++) {
      const x = this.x(times[i]), one = numbers[i] === 1;
      if (x < -NUMBER_PX || x > this.width + NUMBER_PX) continue;
      context.font = `${one ? 700 : 400} 10px system-ui, sans-serif`;
      context.fillStyle = this.ink(one ? "--ink" : "--tick");
      context.fillText(numbers[i], x - context.measureText(numbers[i]).width / 2, top + 8);
    }
    return true;
  }

  #drawBeats(context) {
    const [top, bottom] = BEATS;
    const ticks = this.#between(this.dance.music_beats_s), pips = this.#between(this.dance.motion_beats_s);
    const roomy = this.width / Math.max(1, pips.length, ticks.length) >= 5;
    context.fillStyle = this.ink("--tick");
    context.globalAlpha = roomy ? 1 : 0.5;
    const numbered = this.#drawNumbers(context, top);
    for (const beat of numbered ? [] : ticks) context.fillRect(this.x(beat) - (roomy ? 1 : 0.5), top, roomy ? 2 : 1, 7);
    context.fillStyle = this.ink("--pip");
    for (const beat of pips) {
      context.beginPath();
      context.arc(this.x(beat), bottom - 3, roomy ? 3 : 1.5, 0, 2 * Math.PI);
      context.fill();
    }
    context.globalAlpha = 1;
  }

  // Index of the block at a time.
  blockAt(timeS) {
    const { blocks } = this.dance;
    let low = 0, high = blocks.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (blocks[middle].start_s <= timeS) low = middle; else high = middle - 1;
    }
    return low;
  }

  // One block for each second or motion word, with its motif number. Blocks that are contiguous in their take touch.
  #drawBlocks(context, fromS, pxPerS, [top, bottom], radius) {
    const { blocks } = this.dance;
    const first = this.blockAt(fromS), last = this.blockAt(fromS + context.canvas.clientWidth / pxPerS);
    const contiguous = (a, b) => a && b && a.take === b.take && Math.abs(a.to_s - b.from_s) < 0.02;
    context.font = "600 11px system-ui, sans-serif";
    for (let i = first; i <= last; i++) {
      const here = blocks[i], before = contiguous(blocks[i - 1], here), after = contiguous(here, blocks[i + 1]);
      const cut = after ? 0.5 : Math.min(2, 0.12 * pxPerS);
      const x = (here.start_s - fromS) * pxPerS;
      const width = Math.max(0.5, (here.end_s - here.start_s) * pxPerS - cut);
      const left = before ? 0 : radius, right = after ? 0 : radius;
      context.fillStyle = this.colours[here.take].css;
      context.beginPath();
      context.roundRect(x, top, width, bottom - top, [left, right, right, left].map((r) => Math.min(r, width / 2)));
      context.fill();
      if (!("motif" in here)) continue;
      const text = `${here.motif}`, wide = context.measureText(text).width;
      if (wide > width - 1 || bottom - top < 20) continue;
      context.fillStyle = here.pinned ? "rgb(0 0 0 / 0.9)" : "rgb(0 0 0 / 0.6)";
      context.fillText(text, x + (width - wide) / 2, (top + bottom) / 2 + 4);
    }
  }

  #drawOverview() {
    const partly = this.shownS < this.durationS - 0.01;
    this.overview.hidden = !partly;
    if (!partly) return;
    const width = this.overview.clientWidth, height = this.overview.clientHeight;
    const scale = width / this.durationS;
    const context = fitted(this.overview, width, height);
    this.#drawBlocks(context, 0, scale, [4, height - 4], 1);
    const from = this.fromS * scale, wide = this.shownS * scale;
    context.fillStyle = this.ink("--panel");
    context.globalAlpha = 0.62;
    context.fillRect(0, 0, from, height);
    context.fillRect(from + wide, 0, width, height);
    context.globalAlpha = 1;
    context.strokeStyle = this.ink("--ink");
    context.lineWidth = 1.5;
    context.beginPath();
    context.roundRect(from + 0.75, 0.75, wide - 1.5, height - 1.5, 4);
    context.stroke();
  }

  #showOverviewHead(timeS) {
    const head = document.getElementById("overview-head");
    head.hidden = this.overview.hidden;
    const x = (timeS / this.durationS) * this.overview.clientWidth;
    if (!head.hidden) moveTo(head, x);
  }
}

// Move an element to x by whole pixels of the screen. What does not move is not drawn again.
function moveTo(element, x) {
  const ratio = devicePixelRatio || 1, rounded = Math.round(x * ratio) / ratio;
  if (element.movedTo === rounded) return;
  element.movedTo = rounded;
  element.style.transform = `translateX(${rounded}px)`;
}

export function clockText(timeS, tenths) {
  const rounded = tenths ? Math.floor(timeS * 10 + 1e-6) / 10 : Math.floor(timeS + 1e-6);
  const rest = rounded % 60;
  return `${Math.floor(rounded / 60)}:${tenths ? rest.toFixed(1).padStart(4, "0") : String(rest).padStart(2, "0")}`;
}

// A cleared canvas context that draws in CSS pixels. Not accelerated: it is drawn once and then belongs to the
// page's static background, while an accelerated layer would be composited again in every frame.
function fitted(canvas, width, height) {
  const ratio = devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.scale(ratio, ratio);
  return context;
}
