// The studio: connects the server's state with the stage, the timeline and the panels.

import { Card } from "/page/card.js";
import { takeColours } from "/page/colours.js";
import { Controls, showCredits } from "/page/controls.js";
import { Counts } from "/page/counts.js";
import { decompressLevels } from "/page/decompress.js";
import { Player } from "/page/player.js";
import { clockText } from "/page/timeline.js";
import { Actions } from "./actions.js";
import { Alternatives } from "./alternatives.js";
import { get, serverPaths, upload } from "./api.js";
import { Build } from "./build.js";
import { Character } from "./character.js";
import { Compare } from "./compare.js";
import { DancerView } from "./dancer_view.js";
import { Dancers } from "./dancers.js";
import { Drop } from "./drop.js";
import { Explain } from "./explain.js";
import { Export } from "./export.js";
import { FloorPlan } from "./floor_plan.js";
import { Jobs } from "./jobs.js";
import { Keyboard } from "./keyboard.js";
import { Lanes } from "./lanes.js";
import { Figures } from "./little_figure.js";
import { attempt, say } from "./messages.js";
import { Palette } from "./palette.js";
import { Selection, selectingGestures } from "./selection.js";
import { Settings } from "./settings.js";
import { SpanTools } from "./span_tools.js";
import { Store } from "./store.js";
import { Tabs } from "./tabs.js";

const $ = (id) => document.getElementById(id);
const NOTHING = { duration_s: 1, fps: 60, blocks: [], takes: [], music_beats_s: [], music_beat_numbers: [], motion_beats_s: [], sections: [] };

class Studio {
  constructor(paths) {
    const store = (this.store = new Store(paths));
    this.jobs = new Jobs(store);
    this.player = new Player(NOTHING, null);
    this.view = new DancerView($("view"), this.player, (time) => this.#showTime(time), () => this.jobs.running > 0);
    this.counts = new Counts(NOTHING);
    this.selection = new Selection(store, () => this.counts);
    this.figures = new Figures(store);
    this.actions = new Actions(store, this.jobs, () => this.player);
    this.alternatives = new Alternatives(store, this.jobs, this.actions, this.figures, () => this.player);
    this.explain = new Explain(store);
    this.palette = new Palette(store, this.actions, this.figures, () => ({ timeline: this.lanes, snap: (time) => this.selection.snap(time) }), () => this.player);
    const settings = new Settings(store, this.actions);
    new Dancers(store, this.actions, () => settings.span);
    this.character = new Character(store);
    new Export(store, this.jobs);
    this.build = new Build(store, this.jobs);
    this.floor = new FloorPlan();
    this.tabs = new Tabs((name) => this.#opened(name));
    this.lanes = null; // made with the first dance
    this.dance = null; // the one shown
    this.song = null;
    this.played = { revision: null, at: 0 }; // the dance that was played last, and when first, in ms of the page
    this.shown = Promise.resolve(); // once the newest state is shown
    new Drop({
      song: (file) => this.openSong(file),
      character: (file) => { this.tabs.open("character"); this.character.send(file); },
      takes: (files) => { this.tabs.open("build"); this.build.build(files); },
    });
    store.before = (revision) => this.#showMotion(revision);
    store.addEventListener("first", ({ detail }) => { if (this.dance) attempt(() => this.view.showPart(detail, this.dance)); });
    store.addEventListener("state", () => attempt(() => this.#show()));
    store.addEventListener("span", () => this.lanes?.showSpan());
    this.#connectButtons();
    this.#hideWhatIsMissing();
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => this.recolour());
  }

  #connectButtons() {
    const on = (id, act) => $(id).addEventListener("click", act);
    on("undo", () => this.actions.undo());
    on("redo", () => this.actions.redo());
    on("to-export", () => this.tabs.open("export"));
    on("song-choose", () => $("song-file").click());
    on("welcome-choose", () => $("song-file").click());
    $("song-file").addEventListener("change", () => {
      const [file] = $("song-file").files;
      $("song-file").value = "";
      if (file) this.openSong(file);
    });
    on("zoom-in", () => this.lanes?.zoomBy(1.5));
    on("zoom-out", () => this.lanes?.zoomBy(1 / 1.5));
    on("snap", () => {
      this.selection.snaps = !this.selection.snaps;
      $("snap").setAttribute("aria-pressed", String(this.selection.snaps));
    });
  }

  // Controls whose path this server does not have are not offered.
  #hideWhatIsMissing() {
    for (const element of document.querySelectorAll("[data-path]")) {
      if (!this.store.has(element.dataset.path)) element.hidden = true;
    }
  }

  // Send a song. When it has been analysed, its first dance is shown and played.
  openSong(file) {
    return attempt(async () => {
      await this.jobs.finish(await this.store.sending(upload("song", file)), `Making a dance to ${file.name}`);
      await this.shown;
      this.player.seek(0);
      this.player.play();
    });
  }

  // Show the newest state, after what is being shown already.
  #show() {
    const { state } = this.store;
    this.#showHeading(state);
    if (!state.dance) return null;
    this.shown = this.shown.catch(() => {}).then(() => this.#showNewest());
    return this.shown;
  }

  // Show a motion before the state of its revision is asked for. If it is not there, the state decides what is shown.
  async #showMotion(revision) {
    if (!this.dance) return;
    await this.shown.catch(() => {});
    await this.view.showMotion(revision, this.dance).catch((error) => { if (!error.status) throw error; });
  }

  async #showNewest() {
    const { state } = this.store, content = contentOf(state);
    const isNew = this.content !== content; // not after a lock, for example
    this.content = content;
    try {
      if (isNew) await this.#showDance(state);
    } catch (error) {
      this.content = null;
      if (error.status !== 409) throw error;
      await this.store.refresh(); // the dance has changed since
      return;
    }
    if (!isNew) this.lanes.redraw();
    $("stage").dataset.revision = state.revision;
    this.store.tellShown();
  }

  #showHeading({ song, dance, project, can_undo, can_redo }) {
    document.body.classList.toggle("empty", !dance);
    $("song-name").textContent = song?.name ?? "choreograph studio";
    document.title = song ? `${song.name} · choreograph studio` : "choreograph studio";
    $("saved").textContent = dance && project.file ? `Saved in ${project.file}` : "";
    $("undo").disabled = !can_undo;
    $("redo").disabled = !can_redo;
  }

  async #showDance(state) {
    const { dance } = state, song = `${state.project.file} ${state.song.name} ${state.song.duration_s}`;
    if (song !== this.song) {
      this.song = song;
      const { levels, levels_per_s: perS } = await get("song/waveform");
      this.levels = await decompressLevels(levels);
      this.levelsPerS = perS;
      this.player.open(dance, `/api/song/audio?of=${encodeURIComponent(state.song.name)}`);
      this.store.select(null);
    }
    const onStage = this.view.show(state); // asks for the motion, which comes while the timeline is drawn
    dance.levels_per_s = this.levelsPerS;
    this.dance = dance;
    this.counts = new Counts(dance);
    this.card = new Card(dance, this.counts);
    if (this.lanes) this.lanes.open(dance, this.levels, this.counts);
    else this.#openLanes(dance);
    $("time-all").textContent = clockText(dance.duration_s, true);
    $("time-now").style.setProperty("--digits", $("time-all").textContent.length);
    this.recolour();
    await onStage;
    if (!this.controls) this.controls = new Controls(this.player, this.view.camera, this.lanes, () => this.view.wake());
    this.floor.show(this.view.paths(), this.player.time);
    this.shownTake = null; // the stage may be a new one
    const unmet = dance.unmet ?? [];
    if (unmet.length && unmet.join() !== this.unmet) say(unmet.join(" "), { error: true });
    this.unmet = unmet.join();
  }

  #openLanes(dance) {
    this.lanes = new Lanes(this.store, dance, this.levels, this.counts, this.player, {
      onHover: (block, x) => this.card.show(this.selection.dragging ? null : block, $("timeline").getBoundingClientRect().left + x, this.colours),
      gestures: selectingGestures(this.selection, (at, counts) => this.actions.moveSeam(at, counts)),
    });
    const { store, selection, actions, tabs, lanes, player } = this;
    this.compare = new Compare(store, actions, this.view, lanes, player);
    new Keyboard({ store, selection, actions, tabs, lanes, player, compare: this.compare });
    new SpanTools(store, selection, actions, player);
    new ResizeObserver(() => lanes.redraw()).observe($("timeline"));
    this.player.addEventListener("soundlost", () => say("This browser cannot play the song. The dance continues without sound.", { error: true }));
  }

  recolour() {
    if (!this.dance || !this.lanes) return;
    const style = getComputedStyle(document.documentElement), number = (name) => Number(style.getPropertyValue(name));
    this.colours = takeColours(this.dance.takes.map(({ name }) => name), number("--block-light"), number("--block-chroma"));
    this.lanes.recolour(this.colours);
    this.view.stage?.renderer?.readColours();
    showCredits(this.dance, this.colours);
    this.shownTake = null;
    this.view.wake();
  }

  #opened(name) {
    if (name === "change" && this.dance) this.alternatives.open();
    if (name === "palette") this.palette.open();
    if (name === "character") this.character.show();
    if (name === "why" && this.dance) this.#explainHere();
    if (name === "settings") this.floor.draw(this.player.time);
  }

  #explainHere() { this.explain.follow(this.player.time, this.lanes.blockAt(this.player.time)); }

  #showTime(time) {
    const { lanes, dance } = this;
    if (!lanes) return;
    const { revision, part } = this.view.stage.dancer;
    const isPlayed = this.player.playing && (!part || (time >= part.from && time < part.to));
    if (isPlayed && revision !== this.played.revision) this.played = { revision, at: performance.now() };
    lanes.show(time);
    const text = clockText(time, true), count = this.counts.textAt(time);
    if (text !== this.text) {
      $("time-now").textContent = this.text = text;
      $("timeline").setAttribute("aria-valuenow", time.toFixed(2));
      $("timeline").setAttribute("aria-valuetext", [`${text} of ${clockText(dance.duration_s, true)}`, count].filter(Boolean).join(", "));
      if (!$("panel-settings").hidden) this.floor.draw(time);
    }
    if (count !== this.count) $("now-count").textContent = this.count = count;
    const index = lanes.blockAt(time), block = dance.blocks[index], take = dance.takes[block.take];
    this.explain.follow(time, index);
    if (block === this.shownTake) return;
    this.shownTake = block;
    const colour = this.colours[block.take];
    $("now").style.setProperty("--take", colour.css);
    $("now-take").textContent = block.figure || take.name;
    $("now-genre").textContent = take.genre;
    const { renderer } = this.view.stage;
    if (renderer) renderer.rim = colour.light.map((v) => 0.12 + 0.3 * v);
  }

  // A state of the page for scripts, such as tests.
  facts() {
    const studio = this, { player, view, store } = this;
    return Object.freeze({
      get time() { return player.time; },
      get playing() { return player.playing; },
      get revision() { return store.state?.revision ?? null; },
      get shownRevision() { return Number($("stage").dataset.revision ?? -1); },
      get span() { return store.span; },
      get character() { return store.state?.character?.name ?? null; },
      get bones() { return store.state?.character?.bones ?? null; },
      get joints() { return store.state?.character?.joints ?? []; },
      get differences() { return studio.lanes?.differences ?? []; },
      get locks() { return store.state?.locks ?? []; },
      get dance() { return store.dance; },
      get busy() { return document.body.getAttribute("aria-busy") === "true"; },
      get playedSince() { return studio.played.at; }, // the dance that is shown
      get part() { return view.stage?.dancer.part ?? null; }, // of the next dance, within the one before
      get dancers() { // the places of their joints, in metres
        const { dancer } = view.stage ?? {};
        return dancer ? (dancer.dancers ?? [dancer]).map(({ positions }) => Array.from(positions)) : [];
      },
      get framesDrawn() { return view.stage?.drawn ?? 0; },
      get loop() { return { ...player.loop }; },
      seek(timeS) { player.seek(timeS); },
    });
  }

  // Changes that other pages make are shown here too.
  listen() {
    const events = new EventSource("/api/events");
    events.addEventListener("message", ({ data }) => {
      const { state, job } = JSON.parse(data), { store, jobs } = this;
      if (jobs.running || store.changing) return; // the page follows its own work
      if (state !== undefined && (state > store.state.revision || !store.dance)) store.refresh();
      else if (job?.state === "running" && !store.dance) attempt(() => jobs.finish({ job: job.job }, "Making the first dance"));
    });
  }
}

// What decides whether a state has another dance than the one shown.
function contentOf({ dance, song, character, settings: { dancers, formation, relation } }) {
  return JSON.stringify([song, character, dancers, formation, relation, dance.blocks, dance.edits, dance.cost, dance.frames, dance.root_origin_m]);
}

const studio = new Studio(await serverPaths());
await attempt(() => studio.store.refresh());
studio.tabs.open("change");
studio.listen();
window.studio = studio.facts();
