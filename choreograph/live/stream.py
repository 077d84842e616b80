"""Frames of a dance at their times, by the clock of the song."""

from __future__ import annotations

import gc
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

_BEHIND = 5  # by which processes that plan come after the one that sends


@contextmanager
def short_collections() -> Iterator[None]:
    """Garbage collections in the block look only at objects that are made in it.

    After a dance was made there are 150,000 others, and a collection of all takes longer than two frames.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def stay_behind() -> None:
    """Let the process that sends run first where this one plans, and let it alone end by Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):  # not on Windows
        os.nice(_BEHIND)


@dataclass(frozen=True)
class Sent:
    """What was sent."""

    n_frames: int
    n_skipped: int  # frames whose time was over before they could be sent
    latest_s: float  # the largest delay of a frame


def send_frames(
    n_frames: int | None,
    fps: float,
    send: Callable[[int, float], None],
    *,
    song_s: Callable[[], float],
    sleep: Callable[[float], None] = time.sleep,
    ended: Callable[[], bool] = lambda: False,
) -> Sent:
    """Send each frame when the song is at its time. A frame that is late by a whole frame is skipped.

    `send` is called with the frame and the time in the song. Without a number of frames, they go on until
    `ended`. `song_s` returns the time in the song, below 0 before it begins. Each frame has its own time in
    it, so that errors do not add up.
    """
    n_sent, n_skipped, latest_s, frame = 0, 0, 0.0, 0
    with short_collections():
        while not ended() and (n_frames is None or frame < n_frames):
            due_s = frame / fps
            now_s = song_s()
            if now_s < due_s:
                sleep(due_s - now_s)
                continue
            late = int((now_s - due_s) * fps)
            if late and (n_frames is None or frame < n_frames - 1):
                step = late if n_frames is None else min(late, n_frames - 1 - frame)
                n_skipped, frame = n_skipped + step, frame + step
                continue
            send(frame, now_s)
            n_sent, latest_s, frame = n_sent + 1, max(latest_s, now_s - due_s), frame + 1
    return Sent(n_sent, n_skipped, latest_s)
