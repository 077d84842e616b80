// What time it is in the dance. With sound, the sound says so; nothing here counts frames.

import { clamp } from "./math.js";

// A browser may say the same time for some frames on end; the picture goes on for at most this long meanwhile.
const STALE_S = 0.06;

export class SoundClock {
  constructor(audio, durationS) {
    this.audio = audio;
    this.durationS = durationS;
    this.wanted = null; // where a seek under way will land
    this.read = { time: 0, at: 0 };
    this.shown = 0;
    audio.addEventListener("seeked", () => this.#landed());
  }

  get time() {
    if (this.wanted !== null) return this.wanted;
    const now = performance.now() / 1000;
    const said = this.audio.currentTime;
    if (said !== this.read.time) this.read = { time: said, at: now };
    const carried = this.playing ? Math.min(now - this.read.at, STALE_S) * this.audio.playbackRate : 0;
    const time = clamp(said + carried, 0, this.durationS);
    const back = this.shown - time;
    // A carried time may come out a little late for the next said one: wait for it rather than step back.
    if (!(this.playing && back > 0 && back < STALE_S)) this.shown = time;
    return this.shown;
  }

  get playing() { return !this.audio.paused && !this.audio.ended; }
  get ended() { return this.audio.ended || this.time >= this.durationS; }
  set speed(speed) { this.audio.playbackRate = speed; }

  async play() { await this.audio.play(); }
  pause() { this.audio.pause(); }

  seek(timeS) {
    this.wanted = clamp(timeS, 0, this.durationS);
    if (!this.audio.seeking) this.audio.currentTime = this.wanted;
  }

  #landed() {
    if (this.wanted === null) return;
    if (Math.abs(this.audio.currentTime - this.wanted) > 1e-3) {
      this.audio.currentTime = this.wanted; // dragged on while the last seek was under way
      return;
    }
    this.shown = this.wanted;
    this.wanted = null;
  }
}

// For a dance without sound, or a browser that cannot play it.
export class SilentClock {
  constructor(durationS) {
    this.durationS = durationS;
    this.from = 0; // dance time at `since`
    this.since = null; // null: paused
    this.rate = 1;
  }

  get time() {
    const gone = this.since === null ? 0 : (performance.now() / 1000 - this.since) * this.rate;
    return clamp(this.from + gone, 0, this.durationS);
  }

  get playing() { return this.since !== null && this.time < this.durationS; }
  get ended() { return this.time >= this.durationS; }
  set speed(speed) { this.#restart(this.time); this.rate = speed; }

  async play() { this.from = this.time; this.since = performance.now() / 1000; }
  pause() { this.from = this.time; this.since = null; }
  seek(timeS) { this.#restart(clamp(timeS, 0, this.durationS)); }

  #restart(timeS) {
    this.from = timeS;
    if (this.since !== null) this.since = performance.now() / 1000;
  }
}
