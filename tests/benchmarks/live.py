"""How evenly `choreograph live` sends frames, seen by a receiver of its own.

    python tests/benchmarks/live.py [--seconds 600] [--runs 3] [--fps 60]

A walking body is sent to a port of this machine, without sound, by as many commands at once as there are
runs. Printed for each are the 99th percentile and the maximum of the jitter (how far a frame arrives from its
time, beside the median), the offset (how late the song's time in a packet is, beside the time of its frame),
and the longest gap between two packets in frames. Run it on an idle machine.
"""

from __future__ import annotations

import argparse
import gc
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import soundfile

from choreograph.formats.register import save_motion
from choreograph.library.repertoire import starter_repertoire
from choreograph.live.vmc import messages_of
from choreograph.motion.motion import Motion

_RATE_HZ = 22050
_NO_MORE_S = 5.0  # after which the command has ended
_SO_TIMESTAMPNS = 35  # of Linux, for which Python has no name
_TIMESPEC = struct.Struct("qq")


def danced(seconds: float) -> Motion:
    """A built-in take, repeated."""
    motion, _ = starter_repertoire().motion(0, stop_s=20)
    n_frames = int(seconds * motion.fps)
    rows = np.arange(n_frames) % motion.n_frames
    return Motion(motion.skeleton, motion.root_pos_m[rows], motion.local_quat[rows], motion.fps)


def received(own: socket.socket, arrivals: list[tuple[float, float]]) -> None:
    """Note when packets arrive, and the song's time in them.

    On Linux, the kernel notes when a packet arrives. Elsewhere, the time is that at which this process reads
    it, which other work delays.
    """
    while True:
        try:
            packet, notes, *_ = own.recvmsg(65535, socket.CMSG_SPACE(_TIMESPEC.size))
        except TimeoutError:
            if arrivals:
                return
            continue
        now_s = time.time()
        for level, kind, data in notes:
            if (level, kind) == (socket.SOL_SOCKET, _SO_TIMESTAMPNS):
                seconds, nanoseconds = _TIMESPEC.unpack(data)
                now_s = seconds + 1e-9 * nanoseconds
        [time_s] = [m.arguments[0] for m in messages_of(packet) if m.address == "/VMC/Ext/T"]
        arrivals.append((now_s, time_s))


def summary(arrivals: list[tuple[float, float]], fps: float, seconds: float) -> str:
    arrived_s, sent_s = np.array(arrivals).T
    frames = np.floor(sent_s * fps + 0.01)
    due_s = frames / fps
    late_s = arrived_s - due_s
    jitter_s = np.abs(late_s - np.median(late_s))
    gap = np.diff(arrived_s).max() * fps
    return (
        f"{len(frames)} of {int(seconds * fps)} frames, jitter p99 "
        f"{1000 * np.percentile(jitter_s, 99):.2f} ms, at most {1000 * jitter_s.max():.1f} ms, offset p99 "
        f"{1000 * np.percentile(sent_s - due_s, 99):.2f} ms, longest gap {gap:.2f} frames"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--fps", type=float, default=60.0)
    given = parser.parse_args()
    gc.disable()  # the receiver would stop for its own collections, which have longer than two frames
    with TemporaryDirectory() as folder:
        dance, song = Path(folder) / "dance.npz", Path(folder) / "song.wav"
        save_motion(dance, danced(given.seconds))
        soundfile.write(song, np.zeros(int(given.seconds * _RATE_HZ), np.float32), _RATE_HZ)
        runs = []
        for _ in range(given.runs):
            own = socket.socket(type=socket.SOCK_DGRAM)
            own.bind(("127.0.0.1", 0))
            own.settimeout(_NO_MORE_S)
            if sys.platform == "linux":
                own.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
            arrivals: list[tuple[float, float]] = []
            thread = threading.Thread(target=received, args=(own, arrivals))
            thread.start()
            command = [sys.executable, "-m", "choreograph", "live", song, "--dance", dance, "--silent"]
            port = str(own.getsockname()[1])
            process = subprocess.Popen([*command, "--port", port, "--fps", str(given.fps)])
            runs.append((process, thread, arrivals))
        for process, thread, arrivals in runs:
            process.wait()
            thread.join()
            print(summary(arrivals, given.fps, given.seconds), flush=True)


if __name__ == "__main__":
    main()
