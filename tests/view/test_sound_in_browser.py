"""The page's sound in Chromium: clicks sound on the media clock, from the start and after a seek."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from browsers import QUIET
from synthetic_pages import write_seconds

from choreograph.view.sound import encode_mp4, song_part

pytestmark = pytest.mark.alone

# Plays two and a half seconds; returns when clicks sounded on the audio context's clock, and pairs of
# that clock and the media element's.
LISTEN = """async ([sound, from]) => {
  const tap = `registerProcessor("tap", class extends AudioWorkletProcessor {
    process([[samples]]) { if (samples) this.port.postMessage([currentFrame, samples.slice()]); return true; }
  })`;
  const context = new AudioContext({ sampleRate: 44100 });
  await context.audioWorklet.addModule(URL.createObjectURL(new Blob([tap], { type: "text/javascript" })));
  const bytes = Uint8Array.from(atob(sound), (c) => c.charCodeAt(0));
  const audio = new Audio(URL.createObjectURL(new Blob([bytes], { type: "audio/mp4" })));
  await new Promise((resolve) => audio.addEventListener("canplaythrough", resolve, { once: true }));
  if (from) { audio.currentTime = from; await new Promise((resolve) => (audio.onseeked = resolve)); }
  const node = new AudioWorkletNode(context, "tap");
  context.createMediaElementSource(audio).connect(node).connect(context.destination);
  const clicks = [], pairs = [];
  node.port.onmessage = ({ data: [frame, samples] }) => samples.forEach((sample, i) => {
    const at = (frame + i) / context.sampleRate;
    if (Math.abs(sample) > 0.2 && !(at - clicks.at(-1) < 0.5)) clicks.push(at);
  });
  await audio.play();
  const end = performance.now() + 2500;
  while (performance.now() < end) {
    pairs.push([context.currentTime, audio.currentTime]);
    await new Promise((resolve) => setTimeout(resolve, 7));
  }
  audio.pause();
  return { clicks, pairs };
}"""


@pytest.fixture(scope="module")
def page(chromium):
    opened = chromium(QUIET).new_page()
    empty = "<!doctype html><title>empty</title>"
    opened.route("**/*", lambda route: route.fulfill(body=empty, content_type="text/html"))
    opened.goto("http://localhost/")  # a secure context, which worklets need; nothing is fetched from it
    return opened


@pytest.mark.parametrize("from_s", [0.0, 3.3])
def test_clicks_sound_on_time(page, tmp_path, from_s):
    song = write_seconds(tmp_path / "song.wav", duration_s=8.0)
    sound = encode_mp4(song_part(song, start_s=0.25, duration_s=7.0))
    recorded = page.evaluate(LISTEN, [base64.b64encode(sound).decode("ascii"), from_s])
    context_s, media_s = np.array(recorded["pairs"]).T
    running = media_s > from_s + 0.7
    lag_s = np.median((media_s - context_s)[running])
    late_s = (np.array(recorded["clicks"]) + lag_s - 0.75) % 1.0
    late_s = np.where(late_s > 0.5, late_s - 1.0, late_s)
    assert len(late_s) >= 2
    assert np.abs(late_s).max() < 0.005
