// Playing, seeking, speed and looping, with either clock.

import { SilentClock, SoundClock } from "./clock.js";
import { clamp } from "./math.js";
import { fromBase64 } from "./decompress.js";

const SHORTEST_LOOP_S = 0.2;

// The address of a sound in base64, or null if there is none.
export function soundUrl(text) {
  return text.trim() ? URL.createObjectURL(new Blob([fromBase64(text)], { type: "audio/mp4" })) : null;
}

export class Player extends EventTarget {
  // soundUrl: the address of the song, or null for a dance without sound.
  constructor(dance, soundUrl) {
    super();
    this.speed = 1;
    this.audio = null;
    this.open(dance, soundUrl);
  }

  // Start again with another dance.
  open(dance, soundUrl) {
    if (this.audio) this.close();
    this.durationS = dance.duration_s;
    this.fps = dance.fps;
    this.loop = { on: false, from: 0, to: this.durationS };
    this.clock = new SilentClock(this.durationS);
    if (soundUrl) this.#openSound(soundUrl);
  }

  #openSound(soundUrl) {
    const audio = new Audio();
    audio.preservesPitch = true;
    audio.preload = "auto";
    audio.addEventListener("error", () => { if (audio === this.audio) this.#loseSound(); });
    audio.addEventListener("timeupdate", () => {
      if (document.hidden) this.tick(performance.now() / 1000); // no frames are drawn then, but loops continue
    });
    for (const name of ["play", "pause", "seeked", "ended"]) audio.addEventListener(name, () => this.#changed());
    audio.src = soundUrl;
    this.audio = audio;
    this.clock = new SoundClock(audio, this.durationS);
    this.clock.speed = this.speed;
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
    const { audio } = this, { src } = audio;
    this.audio = null;
    audio.removeAttribute("src"); // first, since revoking the URL of a sound that is still loading is an error
    audio.load();
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
