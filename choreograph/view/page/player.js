// Playing, seeking, speed and looping, with either clock.

import { SilentClock, SoundClock } from "./clock.js";
import { clamp } from "./math.js";
import { fromBase64 } from "./decompress.js";

const SHORTEST_LOOP_S = 0.2;

export class Player extends EventTarget {
  constructor(dance, sound) {
    super();
    this.durationS = dance.duration_s;
    this.fps = dance.fps;
    this.speed = 1;
    this.loop = { on: false, from: 0, to: this.durationS };
    this.audio = null;
    this.clock = new SilentClock(this.durationS);
    if (sound.trim()) this.#openSound(sound);
  }

  #openSound(sound) {
    const audio = new Audio();
    audio.preservesPitch = true;
    audio.preload = "auto";
    audio.addEventListener("error", () => this.#loseSound());
    audio.addEventListener("timeupdate", () => {
      if (document.hidden) this.tick(performance.now() / 1000); // no frames are drawn then, but loops continue
    });
    for (const name of ["play", "pause", "seeked", "ended"]) audio.addEventListener(name, () => this.#changed());
    audio.src = URL.createObjectURL(new Blob([fromBase64(sound)], { type: "audio/mp4" }));
    this.audio = audio;
    this.clock = new SoundClock(audio, this.durationS);
  }

  #loseSound() {
    const { time } = this.clock;
    const wasPlaying = this.clock.playing;
    this.audio = null;
    this.clock = new SilentClock(this.durationS);
    this.clock.seek(time);
    this.clock.speed = this.speed;
    if (wasPlaying) this.clock.play();
    this.dispatchEvent(new Event("soundlost"));
    this.#changed();
  }

  #changed() { this.dispatchEvent(new Event("change")); }

  get time() { return this.clock.time; }
  get playing() { return this.clock.playing; }
  get muted() { return this.audio?.muted ?? true; }

  // The time at `now`, in seconds. Jumps back at the end of a loop and pauses at the end of the dance.
  tick(now) {
    const { loop, clock } = this;
    clock.follow(now);
    if (clock.playing || clock.ended) {
      const over = clock.time >= loop.to || (clock.ended && loop.to >= this.durationS - 1e-3);
      if (loop.on && clock.seekTarget === null && over) {
        this.seek(loop.from);
        if (!clock.playing) this.play();
      } else if (clock.ended && clock.since != null) {
        clock.pause();
        this.#changed();
      }
    }
    return clock.time;
  }

  async play() {
    const { loop } = this;
    if (this.time >= (loop.on ? loop.to : this.durationS) - 1e-3) this.seek(loop.on ? loop.from : 0);
    try {
      await this.clock.play();
    } catch (error) {
      if (error.name === "NotSupportedError") this.#loseSound();
      else if (error.name !== "AbortError" && error.name !== "NotAllowedError") throw error;
    }
    this.#changed();
  }

  pause() { this.clock.pause(); this.#changed(); }

  // Stop for good and release the sound.
  close() {
    this.clock.pause();
    if (!this.audio) return;
    const { src } = this.audio;
    this.audio.removeAttribute("src"); // first, since revoking the URL of a sound that is still loading is an error
    this.audio.load();
    URL.revokeObjectURL(src);
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }
  seek(timeS) { this.clock.seek(clamp(timeS, 0, this.durationS)); this.#changed(); }

  // Pause, and go a number of frames back or forward.
  step(frames) {
    if (this.playing) this.pause();
    this.seek((Math.round(this.time * this.fps) + frames) / this.fps);
  }

  setSpeed(speed) { this.speed = speed; this.clock.speed = speed; this.#changed(); }
  setMuted(muted) { if (this.audio) this.audio.muted = muted; this.#changed(); }
  setLooping(on) { this.loop.on = on; this.#changed(); }

  // A range to loop. Its ends may come in either order.
  setLoop(a, b) {
    const from = clamp(Math.min(a, b), 0, Math.max(0, this.durationS - SHORTEST_LOOP_S));
    this.loop = { on: true, from, to: clamp(Math.max(a, b), from + SHORTEST_LOOP_S, this.durationS) };
    this.#changed();
  }
}
