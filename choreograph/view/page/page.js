// The preview page: connects player, stage and timeline.

import { Card } from "./card.js";
import { Counts } from "./counts.js";
import { takeColours } from "./colours.js";
import { Controls, showCredits } from "./controls.js";
import { Film } from "./film.js";
import { OrbitControls } from "./orbit.js";
import { Player, soundUrl } from "./player.js";
import { Stage } from "./stage.js";
import { Timeline, clockText } from "./timeline.js";
import { consumeText, decompressLevels } from "./decompress.js";

const $ = (id) => document.getElementById(id);

class Page {
  constructor(dance, dancer, renderer, levels, sound) {
    this.dance = dance;
    this.player = new Player(dance, soundUrl(sound));
    this.stage = new Stage($("view"), renderer, (time) => this.#showTime(time));
    this.stage.show(dancer, this.player);
    if (dance.shots) this.stage.camera.film = new Film(dance.shots);
    this.counts = new Counts(dance);
    this.card = new Card(dance, this.counts);
    this.timeline = new Timeline(dance, levels, this.counts, this.player, { onHover: (block, x) => this.#hover(block, x) });
    this.shown = null; // the take named in the heading
    $("time-all").textContent = clockText(dance.duration_s, true);
    $("time-now").style.setProperty("--digits", $("time-all").textContent.length);
    new Controls(this.player, this.stage.camera, this.timeline, () => this.stage.wake());
    new OrbitControls(this.stage);
    if (!renderer) {
      notice("This browser does not support WebGL 2, so the dancer is not shown. The song and the timeline still work.");
    }
    this.player.addEventListener("soundlost", () => {
      notice("This browser cannot play the song. The dance continues without sound.");
    });
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => this.recolour());
    new ResizeObserver(() => this.timeline.redraw()).observe($("stage"));
    this.recolour();
  }

  recolour() {
    const style = getComputedStyle(document.documentElement);
    const number = (name) => Number(style.getPropertyValue(name));
    const names = this.dance.takes.map((take) => take.name);
    this.colours = takeColours(names, number("--block-light"), number("--block-chroma"));
    this.stage.renderer?.readColours();
    this.timeline.recolour(this.colours);
    showCredits(this.dance, this.colours);
    this.shown = null;
    this.stage.wake();
  }

  #hover(block, x) {
    const left = $("timeline").getBoundingClientRect().left;
    this.card.show(block, left + x, this.colours);
  }

  #showTime(time) {
    this.timeline.show(time);
    const count = this.counts.textAt(time);
    if (count !== this.count) $("now-count").textContent = this.count = count;
    const text = clockText(time, true);
    if (text !== this.text) {
      $("time-now").textContent = this.text = text;
      const slider = $("timeline");
      slider.setAttribute("aria-valuenow", time.toFixed(2));
      const all = clockText(this.dance.duration_s, true);
      slider.setAttribute("aria-valuetext", [`${text} of ${all}`, this.source(time).name, count].filter(Boolean).join(", "));
    }
    const source = this.source(time);
    if (source === this.shown) return;
    this.shown = source;
    const colour = this.colours[this.dance.takes.indexOf(source)];
    $("now").style.setProperty("--take", colour.css);
    $("now-take").textContent = source.name;
    $("now-genre").textContent = source.genre;
    const { renderer } = this.stage;
    if (renderer) renderer.rim = colour.light.map((v) => 0.12 + 0.3 * v);
  }

  // The take danced at a time.
  source(timeS) {
    return this.dance.takes[this.dance.blocks[this.timeline.blockAt(timeS)].take];
  }

  // The public read-only state: see the documentation of `write_page`.
  state() {
    const page = this, { player, stage, dance } = this, { camera, dancer } = stage;
    return Object.freeze({
      get time() { return player.time; },
      get frame() { return Math.round(player.time * dance.fps); },
      get fps() { return dance.fps; },
      get duration() { return dance.duration_s; },
      get playing() { return player.playing; },
      get speed() { return player.speed; },
      get loop() { return { ...player.loop }; },
      get mirrored() { return camera.mirrored; },
      get shot() { return camera.shot(player.time)?.name ?? null; },
      get following() { return camera.following; },
      get audioTime() { return player.audio ? player.audio.currentTime : null; },
      get framesDrawn() { return stage.drawn; },
      get pixelScale() { return stage.renderer?.resolution.scale ?? 0; },
      get shownFrom() { return page.timeline.fromS; },
      get shownTo() { return Math.min(dance.duration_s, page.timeline.fromS + page.timeline.shownS); },
      get take() { return page.source(player.time).name; },
      get count() { return page.counts.at(player.time); },
      get dancers() {
        dancer.pose(player.time);
        return (dancer.dancers ?? [dancer]).map(({ positions }) => dance.names.map((_, j) => Array.from(positions.subarray(3 * j, 3 * j + 3))));
      },
      get joints() {
        dancer.pose(player.time);
        return dance.names.map((_, j) => Array.from(dancer.positions.subarray(3 * j, 3 * j + 3)));
      },
    });
  }
}

// A line on the stage.
export function notice(text) {
  $("notice").textContent = text;
  $("notice").hidden = false;
}

// Opens the page: its state is then `window.choreograph`.
export async function openPage(dance, dancer, renderer) {
  const levels = await decompressLevels(consumeText("levels"));
  window.choreograph = new Page(dance, dancer, renderer, levels, consumeText("sound")).state();
}
