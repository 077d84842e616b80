// Plays the dances one after another, asks the questions and saves the answers.

import { Answers } from "./answers.js";
import { createElement } from "./elements.js";
import { OrbitControls } from "./orbit.js";
import { Player } from "./player.js";
import { Questions } from "./questions.js";
import { Dancer } from "./skeleton.js";
import { Stage } from "./stage.js";
import { consumeText, decompressMesh, decompressMotion } from "./decompress.js";

const $ = (id) => document.getElementById(id);

class Study {
  constructor(study, mesh) {
    this.study = study;
    this.answers = new Answers(study);
    this.stage = new Stage($("view"), mesh, (time) => { $("seek").value = time; });
    this.questions = new Questions($("questions"), study.questions, (question, points) => {
      this.answers.give(this.dance.id, question, points);
    });
    this.player = null;
    if (!this.stage.renderer) notice("This browser does not support WebGL 2. Please use another one.");
    this.answers.addEventListener("change", () => this.#showProgress());
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => {
      this.stage.renderer?.readColours();
      this.stage.wake();
    });
    this.#listen();
  }

  get dance() { return this.study.dances[this.answers.at]; }

  #listen() {
    const on = (id, act) => $(id).addEventListener("click", act);
    on("play", () => this.player.toggle());
    on("big-play", () => this.player.play());
    on("back", () => this.go(this.answers.at - 1));
    on("next", () => this.go(this.answers.at + 1));
    on("help", () => this.welcome());
    on("save", () => this.save());
    on("another", () => { this.answers.startOver(); location.reload(); });
    $("seek").addEventListener("input", () => this.player.seek(Number($("seek").value)));
    $("rater-name").addEventListener("change", () => { this.answers.name = $("rater-name").value; });
    addEventListener("keydown", (event) => this.#key(event));
  }

  // Goes to a dance and plays it; past the last one, to the end of the study.
  async go(index) {
    if (index < 0) return;
    if (index >= this.study.dances.length) { this.finish(); return; }
    this.answers.at = index;
    await this.show();
    this.player.play();
    $("heading").focus();
  }

  async show() {
    const { dance, study } = this;
    this.player?.close();
    const whole = { ...study.body, ...dance };
    const sound = dance.sound === null ? "" : $(`sound-${dance.sound}`).textContent;
    this.player = new Player(whole, sound);
    this.player.addEventListener("change", () => this.#showPlayer());
    this.player.addEventListener("soundlost", () => {
      notice("This browser cannot play the song. Please use another one.");
    });
    document.body.classList.remove("started");
    $("seek").max = dance.duration_s;
    this.questions.show(this.answers.of(dance.id));
    this.#showProgress();
    this.#showPlayer();
    const { player } = this;
    const motion = await decompressMotion($(`dance-${dance.id}`).textContent, whole);
    if (player === this.player) this.stage.show(new Dancer(whole, motion), player);
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
    const all = study.dances.length, done = all - answers.open.length;
    $("heading").textContent = `Dance ${answers.at + 1} of ${all}`;
    $("done").textContent = done === all ? "all rated" : `${done} rated`;
    $("progress").firstElementChild.style.width = `${(100 * done) / all}%`;
    $("back").disabled = answers.at === 0;
    $("next").textContent = answers.at === all - 1 ? "Finish" : "Next dance";
    $("next").classList.toggle("ready", answers.isDone(this.dance.id));
  }

  welcome() {
    const count = this.study.dances.length, asked = this.study.questions.length;
    const sound = this.study.sound ? "Please turn the sound on." : "There is no sound.";
    $("task").textContent = `You will see ${count} short dances and answer ${asked} questions about each. ${sound}`;
    $("rater-name").value = this.answers.name;
    $("begin").textContent = Object.keys(this.answers.state.answers).length ? "Continue" : "Start";
    this.player.pause();
    $("welcome").showModal();
  }

  finish() {
    const { open } = this.answers;
    this.player.pause();
    $("finish-title").textContent = open.length ? "Not all dances are rated yet" : "All dances are rated. Thank you!";
    $("open-dances").replaceChildren(...(open.length ? ["Not rated yet:", made("br")] : []), ...open.map((i) => {
      const button = made("button", "", [`${i + 1}`]);
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
    for (const points of [0, 1, 2, 3, 4, 5]) acts[points] = () => questions.answer(points);
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
      get dance() { return page.dance.id; },
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
