// What time it is in the dance. With sound, the sound says so; nothing here counts frames.

import { clamp } from "./math.js";

// A sound's clock is read once a frame and read raggedly: some milliseconds early or late, in some browsers the
// same for a few frames. The picture moves on evenly and is drawn to the clock, so it never drifts from the sound.
const DRAWN_S = 0.25; // time in which most of a difference is gone
const JUMP_S = 0.08; // a difference that is no raggedness: the sound has jumped
const STALE_S = 0.1; // a clock that says the same for longer has stopped

export class SoundClock {
  constructor(audio, durationS) {
    this.audio = audio;
    this.durationS = durationS;
    this.wanted = null; // where a seek under way will land
    this.time = 0; // in the dance, at the last frame
    this.meant = false; // to play
    this.followed = { at: 0, said: 0, changedAt: -1, playing: false };
    audio.addEventListener("seeked", () => this.#landed());
  }

  get playing() { return !this.audio.paused && !this.audio.ended; }
  get ended() { return this.audio.ended || this.time >= this.durationS; }
  set speed(speed) { this.audio.playbackRate = speed; }

  // A seek under way lands first: one that passes the end on its way would stop the sound there. A seek in a
  // sound that is not loaded yet (phones wait for the first play) is under way only once it is.
  async play() {
    this.meant = true;
    while (this.audio.seeking) {
      await new Promise((landed) => this.audio.addEventListener("seeked", landed, { once: true }));
    }
    if (this.meant) await this.audio.play();
  }

  pause() {
    this.meant = false;
    this.audio.pause();
  }

  // Bring `time` to the instant `now` of the browser's clock, seconds.
  follow(now) {
    const { followed, playing } = this;
    const said = this.audio.currentTime;
    const started = playing && !followed.playing;
    const changedAt = started ? -1 : said !== followed.said ? now : followed.changedAt;
    if (this.wanted === null) {
      const elapsed = Math.max(0, now - followed.at);
      const going = playing && changedAt >= 0;
      const time = going ? this.#drawn(elapsed, said, now - changedAt) : said;
      this.time = clamp(time, 0, this.durationS);
    }
    this.followed = { at: now, said, changedAt, playing };
  }

  // The time to show `elapsed` seconds after the last, drawn towards what the sound says.
  #drawn(elapsed, said, staleFor) {
    const even = this.time + elapsed * this.audio.playbackRate;
    const off = said - even;
    if (Math.abs(off) > JUMP_S) return said;
    if (staleFor > STALE_S) return this.time;
    return staleFor > 0 ? even : even + off * (1 - Math.exp(-elapsed / DRAWN_S));
  }

  seek(timeS) {
    this.wanted = this.time = clamp(timeS, 0, this.durationS);
    if (!this.audio.seeking) this.audio.currentTime = this.wanted;
  }

  #landed() {
    if (this.wanted === null) return;
    if (Math.abs(this.audio.currentTime - this.wanted) > 1e-3) {
      this.audio.currentTime = this.wanted; // dragged on while the last seek was under way
      return;
    }
    this.wanted = null;
    this.followed.playing = false; // the sound takes a moment to start again
  }
}

// For a dance without sound, or a browser that cannot play it.
export class SilentClock {
  constructor(durationS) {
    this.durationS = durationS;
    this.from = 0; // dance time at `since`
    this.since = null; // null: paused
    this.rate = 1;
    this.wanted = null; // a seek here is done at once
  }

  follow() {} // time is read when it is asked for

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
