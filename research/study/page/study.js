// Plays the dances and pairs of dances one after another, asks the questions and saves the answers.

import { Answers } from "./answers.js";
import { createElement } from "./elements.js";
import { OrbitControls } from "./orbit.js";
import { Player, soundUrl } from "./player.js";
import { Questions, SIDES } from "./questions.js";
import { Renderer } from "./renderer.js";
import { Dancer } from "./skeleton.js";
import { Stage } from "./stage.js";
import { consumeText, decompressMesh, decompressMotion } from "./decompress.js";

const $ = (id) => document.getElementById(id);

class Study {
  constructor(study, mesh) {
    this.study = study;
    this.answers = new Answers(study);
    this.stage = new Stage($("view"), Renderer.open($("view"), mesh), (time) => { $("seek").value = time; });
    this.questions = new Questions($("questions"), (question, answer) => {
      this.answers.give(this.item.id, question, answer);
    });
    this.player = null;
    this.dancers = []; // of the item, one or two
    this.side = 0; // the one that is shown
    if (!this.stage.renderer) notice("This browser does not support WebGL 2. Please use another one.");
    this.answers.addEventListener("change", () => this.#showProgress());
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => {
      this.stage.renderer?.readColours();
      this.stage.wake();
    });
    this.#listen();
  }

  get item() { return this.answers.items[this.answers.at]; }

  #listen() {
    const on = (id, act) => $(id).addEventListener("click", act);
    on("play", () => this.player.toggle());
    on("big-play", () => this.player.play());
    on("back", () => this.go(this.answers.at - 1));
    on("next", () => this.go(this.answers.at + 1));
    on("help", () => this.welcome());
    on("save", () => this.save());
    on("another", () => { this.answers.startOver(); location.reload(); });
    SIDES.forEach((side, i) => on(`side-${i}`, () => this.watch(i)));
    $("seek").addEventListener("input", () => this.player.seek(Number($("seek").value)));
    $("rater-name").addEventListener("change", () => { this.answers.name = $("rater-name").value; });
    addEventListener("keydown", (event) => this.#key(event));
  }

  // Goes to a dance or pair and plays it, or after the last one to the end of the study.
  async go(index) {
    if (index < 0) return;
    if (index >= this.answers.items.length) { this.finish(); return; }
    this.answers.at = index;
    await this.show();
    this.player.play();
    $("heading").focus();
  }

  async show() {
    const { item, study } = this;
    const wholes = item.dances.map((id) => ({ ...study.body, ...study.dances.find((dance) => dance.id === id) }));
    const [{ sound, duration_s }] = wholes; // the dances of a pair are to the same part of a song
    this.player?.close();
    this.player = new Player(wholes[0], sound === null ? null : soundUrl($(`sound-${sound}`).textContent));
    this.player.addEventListener("change", () => this.#showPlayer());
    this.player.addEventListener("soundlost", () => {
      notice("This browser cannot play the song. Please use another one.");
    });
    document.body.classList.remove("started");
    $("seek").max = duration_s;
    this.questions.show(item, this.answers.of(item.id));
    this.#showProgress();
    this.#showPlayer();
    const { player } = this;
    const motions = await Promise.all(wholes.map((whole) => decompressMotion($(`dance-${whole.id}`).textContent, whole)));
    if (player !== this.player) return;
    this.dancers = motions.map((motion, i) => new Dancer(wholes[i], motion));
    $("sides").hidden = this.dancers.length < 2;
    this.watch(0);
  }

  // Shows the other dance of a pair at the same instant.
  watch(side) {
    this.side = side;
    SIDES.forEach((_, i) => $(`side-${i}`).setAttribute("aria-pressed", `${i === side}`));
    this.stage.show(this.dancers[side], this.player);
  }

  #showPlayer() {
    const { player } = this;
    document.body.classList.toggle("playing", player.playing);
    if (player.playing || player.time > 0) document.body.classList.add("started");
    $("play").setAttribute("aria-label", player.playing ? "Pause" : "Play");
    this.stage.wake();
  }

  #showProgress() {
    const { answers, study } = this;
    const all = answers.items.length, done = all - answers.open.length;
    const pairs = study.pairs.length, single = all - pairs;
    $("heading").textContent = this.questions.isPair
      ? `Pair ${answers.at + 1 - single} of ${pairs}` : `Dance ${answers.at + 1} of ${single}`;
    $("done").textContent = done === all ? "all answered" : `${done} of ${all} answered`;
    $("progress").firstElementChild.style.width = `${(100 * done) / all}%`;
    $("back").disabled = answers.at === 0;
    $("next").textContent = answers.at === all - 1 ? "Finish" : "Next";
    $("next").classList.toggle("ready", answers.isDone(this.item));
  }

  welcome() {
    const { questions, pairs, sound } = this.study, single = this.answers.items.length - pairs.length;
    const parts = [];
    if (single) parts.push(`${single} short dances and answer ${questions.length} questions about each, from 0 (very poor) to 5 (excellent)`);
    if (pairs.length) parts.push(`${pairs.length} pair${pairs.length > 1 ? "s" : ""} of dances, A and B, and choose one of the two for each question`);
    $("task").textContent = `You will see ${parts.join(", then ")}. ${sound ? "Please turn the sound on." : "There is no sound."}`;
    $("rater-name").value = this.answers.name;
    $("begin").textContent = Object.keys(this.answers.state.answers).length ? "Continue" : "Start";
    this.player.pause();
    $("welcome").showModal();
  }

  finish() {
    const { open } = this.answers;
    this.player.pause();
    $("finish-title").textContent = open.length ? "Not all questions are answered yet" : "All questions are answered. Thank you!";
    $("open-dances").replaceChildren(...(open.length ? ["Not answered yet:", createElement("br")] : []), ...open.map((i) => {
      const button = createElement("button", "", [`${i + 1}`]);
      button.type = "button";
      button.addEventListener("click", () => { $("finish").close(); this.go(i); });
      return button;
    }));
    $("saved").textContent = open.length ? "You can also save your answers so far." : "Now save your answers.";
    $("another").hidden = true;
    $("finish").showModal();
    $("save").focus();
  }

  save() {
    const { name, text } = this.answers.file();
    const link = createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
    $("saved").textContent = `Saved as ${name}. Please send this file to the person who gave you this page.`;
    $("another").hidden = false;
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const { player, questions, answers } = this;
    const kind = event.target.type; // form controls keep their own keys: arrows, and space on a button
    const acts = {
      " ": () => player.toggle(),
      ArrowLeft: () => player.seek(player.time - 1),
      ArrowRight: () => player.seek(player.time + 1),
      ArrowUp: () => questions.mark(questions.marked - 1),
      ArrowDown: () => questions.mark(questions.marked + 1),
      n: () => this.go(answers.at + 1),
      p: () => this.go(answers.at - 1),
      "?": () => this.welcome(),
    };
    if (questions.isPair) {
      SIDES.forEach((side, i) => { acts[side.toLowerCase()] = () => questions.answer(i); });
      acts.s = () => this.watch(1 - this.side);
    } else {
      for (const points of [0, 1, 2, 3, 4, 5]) acts[points] = () => questions.answer(points);
    }
    const act = acts[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    const own = event.key.startsWith("Arrow") ? kind === "radio" || kind === "range"
      : event.key === " " && (kind === "button" || (kind === "radio" && !event.target.checked));
    if (!act || own) return;
    event.preventDefault();
    act();
  }

  // Read-only state for tests and scripts.
  state() {
    const page = this;
    return Object.freeze({
      get item() { return page.item.id; },
      get side() { return page.side; },
      get answers() { return structuredClone(page.answers.state.answers); },
      get time() { return page.player.time; },
      get playing() { return page.player.playing; },
      get audioTime() { return page.player.audio ? page.player.audio.currentTime : null; },
      get framesDrawn() { return page.stage.drawn; },
      get joints() { return Array.from(page.stage.dancer.positions); },
    });
  }
}

function notice(text) {
  $("notice").textContent = text;
  $("notice").hidden = false;
}

const study = JSON.parse(consumeText("study"));
const page = new Study(study, await decompressMesh(consumeText("mesh"), study.body.mesh));
await page.show();
new OrbitControls(page.stage);
window.choreograph = page.state();
page.welcome();
