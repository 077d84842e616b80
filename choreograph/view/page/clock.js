// The time in the dance. With sound it follows the media clock. Nothing here counts frames.

import { clamp } from "./math.js";

// The media clock, read once per frame, jitters. It is some milliseconds early or late, and in some browsers constant
// for a few frames. The picture advances evenly and is corrected towards that clock, so it never drifts from the sound.
const CORRECTION_S = 0.25; // time constant of that correction
const JUMP_S = 0.08; // a larger difference is not jitter but a jump of the sound
const STALE_S = 0.1; // a clock that is constant for longer has stopped

export class SoundClock {
  constructor(audio, durationS) {
    this.audio = audio;
    this.durationS = durationS;
    this.seekTarget = null; // target of a pending seek
    this.time = 0; // in the dance, at the last frame
    this.playRequested = false; // play was requested
    this.lastReading = { at: 0, reported: 0, changedAt: -1, playing: false };
    audio.addEventListener("seeked", () => this.#landed());
  }

  get playing() { return !this.audio.paused && !this.audio.ended; }
  get ended() { return this.audio.ended || this.time >= this.durationS; }
  set speed(speed) { this.audio.playbackRate = speed; }

  // Waits for a pending seek, since one beyond the end would stop the sound there. In a sound that is not loaded
  // yet (phones wait for the first play), a seek becomes pending only once it is loaded.
  async play() {
    this.playRequested = true;
    while (this.audio.seeking) {
      await new Promise((landed) => this.audio.addEventListener("seeked", landed, { once: true }));
    }
    if (this.playRequested) await this.audio.play();
  }

  pause() {
    this.playRequested = false;
    this.audio.pause();
  }

  // Update `time` to `now`, seconds of the browser's clock.
  follow(now) {
    const { lastReading, playing } = this;
    const reported = this.audio.currentTime;
    const started = playing && !lastReading.playing;
    // A seek to where the sound already is may have no event: to the start of one that is not loaded yet.
    if (this.seekTarget !== null && !this.audio.seeking && Math.abs(reported - this.seekTarget) < 1e-3) this.#landed();
    const changedAt = started ? -1 : reported !== lastReading.reported ? now : lastReading.changedAt;
    if (this.seekTarget === null) {
      const elapsed = Math.max(0, now - lastReading.at);
      const going = playing && changedAt >= 0;
      const time = going ? this.#corrected(elapsed, reported, now - changedAt) : reported;
      this.time = clamp(time, 0, this.durationS);
    }
    this.lastReading = { at: now, reported, changedAt, playing };
  }

  // The time to show `elapsed` seconds after the last one, corrected towards the reported time.
  #corrected(elapsed, reported, staleFor) {
    const even = this.time + elapsed * this.audio.playbackRate;
    const error = reported - even;
    if (Math.abs(error) > JUMP_S) return reported;
    if (staleFor > STALE_S) return this.time;
    return staleFor > 0 ? even : even + error * (1 - Math.exp(-elapsed / CORRECTION_S));
  }

  seek(timeS) {
    this.seekTarget = this.time = clamp(timeS, 0, this.durationS);
    if (!this.audio.seeking) this.audio.currentTime = this.seekTarget;
  }

  #landed() {
    if (this.seekTarget === null) return;
    if (Math.abs(this.audio.currentTime - this.seekTarget) > 1e-3) {
      this.audio.currentTime = this.seekTarget; // a newer seek was requested meanwhile
      return;
    }
    this.seekTarget = null;
    this.lastReading.playing = false; // the sound needs a moment to restart
  }
}

// For a dance without sound, or a browser that cannot play it.
export class SilentClock {
  constructor(durationS) {
    this.durationS = durationS;
    this.from = 0; // dance time at `since`
    this.since = null; // null: paused
    this.rate = 1;
    this.seekTarget = null; // a seek takes effect at once
  }

  follow() {} // time is computed on demand

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
