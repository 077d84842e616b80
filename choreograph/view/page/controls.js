// Buttons and keyboard shortcuts.

import { createElement } from "./elements.js";

const SPEEDS = [1, 0.5];

export class Controls {
  constructor(player, camera, timeline, wake) {
    Object.assign(this, { player, camera, timeline, wake });
    const on = (id, act) => document.getElementById(id).addEventListener("click", act);
    on("play", () => player.toggle());
    on("big-play", () => player.play());
    on("speed", () => this.#changeSpeed());
    on("loop", () => player.setLooping(!player.loop.on));
    on("mirror", () => this.#mirror());
    on("follow", () => this.#follow());
    on("mute", () => player.setMuted(!player.muted));
    on("help", () => this.#help());
    player.addEventListener("change", () => this.show());
    addEventListener("keydown", (event) => this.#key(event));
    this.show();
  }

  show() {
    const { player, camera } = this;
    document.body.classList.toggle("playing", player.playing);
    document.body.classList.toggle("muted", player.muted);
    if (player.playing || player.time > 0) document.body.classList.add("started");
    document.getElementById("play").setAttribute("aria-label", player.playing ? "Pause" : "Play");
    const pressed = {
      speed: player.speed < 1, loop: player.loop.on, mirror: camera.mirrored, follow: camera.following,
      mute: player.muted,
    };
    for (const [id, state] of Object.entries(pressed)) {
      document.getElementById(id).setAttribute("aria-pressed", state);
    }
    document.getElementById("mute").hidden = player.audio === null;
    this.timeline.showLoop(player.loop);
    this.wake();
  }

  #changeSpeed() { this.player.setSpeed(SPEEDS[(SPEEDS.indexOf(this.player.speed) + 1) % SPEEDS.length]); }
  #mirror() { this.camera.mirrored = !this.camera.mirrored; this.show(); }
  #follow() { this.camera.following = !this.camera.following; this.show(); }
  #help() {
    const keys = document.getElementById("keys");
    keys.showModal();
    keys.scrollTop = 0; // and not at the button, which has the focus
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || document.getElementById("keys").open) return;
    const { player, timeline } = this;
    const { time, loop } = player;
    const walk = (sign) => (event.shiftKey ? player.step(sign) : player.seek(time + sign));
    const acts = {
      " ": () => player.toggle(),
      ArrowLeft: () => walk(-1),
      ArrowRight: () => walk(1),
      Home: () => player.seek(0),
      End: () => player.seek(player.durationS),
      s: () => this.#changeSpeed(),
      m: () => this.#mirror(),
      f: () => this.#follow(),
      l: () => player.setLooping(!loop.on),
      i: () => player.setLoop(time, loop.to > time ? loop.to : player.durationS),
      o: () => player.setLoop(loop.from < time ? loop.from : 0, time),
      u: () => player.setMuted(!player.muted),
      "+": () => timeline.zoomBy(1.5, timeline.x(time)),
      "=": () => timeline.zoomBy(1.5, timeline.x(time)),
      "-": () => timeline.zoomBy(1 / 1.5, timeline.x(time)),
      0: () => timeline.showAll(),
      "?": () => this.#help(),
    };
    const act = acts[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    // Space and Enter on a focused button or link press it, as usual.
    const pressing = event.key === " " && event.target.closest?.("button, summary");
    const typing = event.target.closest?.("input, select, textarea, dialog");
    if (!act || pressing || typing || event.defaultPrevented) return;
    event.preventDefault();
    act();
  }
}

// A line of totals, and a table of the takes with the seconds danced and the credits.
export function showCredits(dance, colours) {
  const danced = dance.takes.map(() => 0);
  dance.blocks.forEach((block) => (danced[block.take] += block.end_s - block.start_s));
  const clips = new Set(dance.blocks.filter((block) => "clip" in block).map((block) => block.clip)).size;
  const takes = new Set(dance.blocks.filter((block) => "speed" in block && !block.kept).map((block) => block.take)).size;
  const words = dance.blocks.filter((block) => "motif" in block).length;
  const count = (n, word) => `${n} ${word}${n === 1 ? "" : "s"}`;
  document.getElementById("totals").textContent =
    `· ${Math.round(dance.duration_s)} s from ${[
      takes && count(takes, "take"),
      dance.blocks.some((block) => !("speed" in block)) && "a network",
      dance.blocks.some((block) => block.kept) && "a dance that is kept",
      clips && count(clips, "clip"), words && count(words, "motion word"),
    ].filter(Boolean).join(", ")}`;
  const rows = dance.takes.map((take, i) => {
    const dot = createElement("i", "dot");
    dot.style.setProperty("--take", colours[i].css);
    const texts = [take.genre, take.performer, take.licence, take.source];
    const cells = texts.map((text) => createElement("td", "", [text || "–"]));
    const name = createElement("td", "", [dot, take.name]);
    return createElement("tr", "", [name, createElement("td", "", [`${danced[i].toFixed(0)} s`]), ...cells]);
  });
  document.querySelector("#credits tbody").replaceChildren(...rows);
}
