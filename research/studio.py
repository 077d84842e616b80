"""What the studio does and costs: times of changes, edits through its API, chains of edits, and memory.

    python research/studio.py [--db rep.h5] [--seconds 60 180] [--changes 10] [--page 10] [--edits 100]
        [--chains 100] [--length 20] [--hour 1200] [--seed 0]

A server is started in a process of its own, with a synthesised song, and is asked as its page asks it. Times
are from the request until the changed dance has been sent, in wall time and in CPU time of the server. With
`--page`, Chromium opens the page, and the times are until a moved weight and a chosen alternative play there.
Then follows what a frame costs (see `research/studio_page.py`). For random edits, the script prints the
seconds that changed outside of the span and two beats on either side. A chain of edits is closed and opened
again in the middle and at the end, and its motions are compared bit by bit. At last come as many requests as
in an hour of work, and the memory of the server.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np

from choreograph.choreography.edits import edit_slots
from choreograph.library.vocabulary import dance_bounds_s
from content.songs.synthesis.song import render_song, write_song
from research.studio_page import frames, page_times

EDITS = "swap", "vary", "hold", "pin_take", "seam", "cut", "repeat"
_POLL_S = 0.02
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class Studio:
    """A running studio."""

    def __init__(self, address: str, process: subprocess.Popen[str], song: Path) -> None:
        self.address, self.process, self.song = address.rstrip("/"), process, song

    def ask(self, method: str, path: str, body: Any = None, name: str = "") -> tuple[int, Any]:
        """The status and the content of a reply."""
        data = body if isinstance(body, bytes) else None if body is None else json.dumps(body).encode()
        headers = {"X-Filename": name} if name else {"Content-Type": "application/json"}
        try:
            with urlopen(Request(self.address + path, data, headers, method=method)) as reply:
                status, content = reply.status, reply.read()
        except HTTPError as error:
            status, content = error.code, error.read()
        return status, content if "/export/" in path else json.loads(content)

    def state(self) -> dict[str, Any]:
        """The state."""
        found: dict[str, Any] = self.ask("GET", "/api/state")[1]
        return found

    def done(self, reply: tuple[int, Any]) -> dict[str, Any]:
        """The job of a reply, when it has ended."""
        status, content = reply
        while status == 202:
            job: dict[str, Any] = self.ask("GET", f"/api/jobs/{content['job']}?wait=0.4")[1]
            if job["state"] != "running":
                return job
        return {"state": "done" if status == 200 else "failed", "error": content.get("error")}

    def change(self, path: str, **body: Any) -> dict[str, Any]:
        """Change the newest state, and wait until it is changed."""
        return self.done(self.ask("POST", path, {"revision": self.state()["revision"], **body}))

    def shown(self) -> None:
        """Fetch what a page fetches after a change."""
        self.state()
        self.ask("GET", "/api/motion")

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """The motion, to the bit."""
        job = self.done(self.ask("POST", "/api/export", {"format": "npz"}))
        content = self.ask("GET", f"/api/export/{job['result']['id']}")[1]
        with np.load(io.BytesIO(content)) as arrays:
            return arrays["root_pos_m"], arrays["local_quat"]

    def reopen(self) -> None:
        """Open the project again from its file."""
        self.done(self.ask("POST", "/api/song", self.song.read_bytes(), self.song.name))

    def cpu_s(self) -> float:
        """CPU time of the server."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S

    def memory_mb(self) -> float:
        """Memory of the server."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.partition("VmRSS:")[2].split()[0]) / 1024


@contextmanager
def running(folder: Path, seconds: float, db: Path | None, seed: int) -> Iterator[Studio]:
    """A studio with a song of so many seconds and its first dance."""
    song = folder / f"song-{seconds:g}.wav"
    write_song(song, render_song("house", bpm=124.0, duration_s=seconds, seed=80_000 + seed))
    command = [sys.executable, "-m", "choreograph", "studio", str(song), "--no-browser"]
    command += [] if db is None else ["--db", str(db)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        began = time.perf_counter()
        studio = Studio(process.stdout.readline().split()[-1], process, song)
        while studio.state()["dance"] is None:
            time.sleep(_POLL_S)
        print(f"{seconds:g} s: first dance {time.perf_counter() - began:.1f} s after the page", flush=True)
        yield studio
    finally:
        process.terminate()
        process.wait()


def timed(studio: Studio, what: str, n: int, change: Any) -> None:
    """Print the times of `n` changes, each until the dance has been sent again."""
    wall_s, cpu_s = [], []
    for i in range(n):
        before, began = studio.cpu_s(), time.perf_counter()
        change(i)
        studio.shown()
        wall_s.append(time.perf_counter() - began)
        cpu_s.append(studio.cpu_s() - before)
    print(
        f"  {what}: median {np.median(wall_s):.2f} s, longest {max(wall_s):.2f} s "
        f"(CPU of the server: {np.median(cpu_s):.2f}, {max(cpu_s):.2f} s)",
        flush=True,
    )


def times(studio: Studio, rng: np.random.Generator, n: int = 10) -> None:
    """Print the times of weights that are moved, alternatives and choices."""
    weights = ("transition", "pace", "energy", "variety", "front")
    offered: list[tuple[int, str]] = []
    duration_s = studio.state()["dance"]["duration_s"]

    def move(i: int) -> None:
        studio.change("/api/settings", changes={"weights": {weights[i % 5]: float(rng.uniform(0.5, 8.0))}})

    def offer(i: int) -> None:
        start_s, revision = float(rng.uniform(2.0, duration_s - 8.0)), studio.state()["revision"]
        body = {"revision": revision, "from": start_s, "to": start_s + 4.0, "n": 8}
        found = studio.done(studio.ask("POST", "/api/alternatives", body))["result"]
        offered[:] = [(revision, found[-1]["id"])]

    def choose(i: int) -> None:
        revision, id = offered[0]
        assert studio.ask("POST", "/api/choose", {"revision": revision, "id": id})[0] == 200

    timed(studio, "a weight moved", n, move)
    timed(studio, "eight alternatives of 4 s", n, offer)
    timed(studio, "one chosen", 1, choose)
    for _ in range(n - 1):
        offer(0)
        timed(studio, "one chosen", 1, choose)
    timed(studio, "an edit", n, lambda i: random_edit(studio, rng))
    timed(studio, "undo", n, lambda i: studio.change("/api/undo"))


def random_edit(
    studio: Studio, rng: np.random.Generator
) -> tuple[dict[str, Any], tuple[float, float]] | None:
    """Make an edit of a random kind, span and seed, and return its job and span, or None if it is refused."""
    dance = studio.state()["dance"]
    bounds_s = dance_bounds_s(np.array(dance["music_beats_s"]), dance["duration_s"])
    bounds_s = np.array([0.0, *bounds_s[1:-1], dance["duration_s"]])
    length_s = float(rng.uniform(1.0, 6.0))
    start_s = float(rng.uniform(0.0, dance["duration_s"] - length_s))
    end_s, kind = start_s + length_s, EDITS[int(rng.integers(len(EDITS)))]
    slots = edit_slots(start_s, end_s, bounds_s)
    first, stop = slots.first, slots.stop
    path, body = "/api/edit", {"kind": kind, "from": start_s, "to": end_s, "seed": int(rng.integers(3))}
    if kind == "pin_take":
        body["take"] = str(rng.choice([take["name"] for take in dance["takes"]]))
    elif kind == "cut":
        body["section"] = int(rng.integers(len(dance["sections"])))
    elif kind == "repeat":
        first = int(rng.integers(0, len(bounds_s) - 1 - (slots.stop - slots.first)))
        stop = first + slots.stop - slots.first
        body |= {"at": float(bounds_s[first]), "mirrored": bool(rng.integers(2))}
    elif kind == "seam":
        path, counts = "/api/seam", int(rng.choice([-4, -3, -2, -1, 1, 2, 3, 4]))
        body = {"at": float(rng.choice(dance["joins"] or [start_s])), "counts": counts}
        slot = int(np.abs(bounds_s - body["at"]).argmin())
        first, stop = (int(np.clip(at, 0, len(bounds_s) - 1)) for at in sorted((slot, slot + counts)))
    job = studio.change(path, **body)
    return None if job["state"] != "done" else (job, (float(bounds_s[first]), float(bounds_s[stop])))


def single_edits(studio: Studio, n: int, rng: np.random.Generator) -> None:
    """Print what `n` random edits change outside of their spans and two beats."""
    dance = studio.state()["dance"]
    fps, beat_s = dance["fps"], float(np.median(np.diff(dance["music_beats_s"])))
    outside_s, refused, before = 0.0, 0, studio.motion()
    made = 0
    while made < n:
        done = random_edit(studio, rng)
        if done is None:
            refused += 1
            continue
        made += 1
        after, (start_s, end_s) = studio.motion(), done[1]
        changed = np.any(after[0] != before[0], axis=1) | np.any(after[1] != before[1], axis=(1, 2))
        times_s = np.arange(len(changed)) / fps
        margin_s = 2 * beat_s + 1 / fps
        allowed = (times_s >= start_s - margin_s) & (times_s <= end_s + margin_s)
        outside_s += float((changed & ~allowed).sum() / fps)
        before = after
    print(
        f"  {n} edits ({refused} refused): {outside_s:.3f} s changed outside of span and two beats",
        flush=True,
    )


def chains(studio: Studio, n: int, length: int, seed: int) -> None:
    """Print how many chains of edits have the same motion after they were opened again."""
    same = 0
    for chain in range(n):
        rng = np.random.default_rng([seed, chain])
        studio.change("/api/settings", changes={"seed": chain})
        done = 0
        while done < length:
            done += random_edit(studio, rng) is not None
            if done == length // 2:
                studio.reopen()
        before = studio.motion()
        studio.reopen()
        after = studio.motion()
        same += all(a.tobytes() == b.tobytes() for a, b in zip(before, after, strict=True))
        if (chain + 1) % 10 == 0:
            print(f"  {chain + 1} chains of {length} edits: {same} the same", flush=True)


def hour(studio: Studio, n: int, rng: np.random.Generator) -> None:
    """Print the memory of the server over `n` changes, with all that pages ask for in between."""
    print(f"  at first: {studio.memory_mb():.0f} MB", flush=True)
    duration_s = studio.state()["dance"]["duration_s"]
    for i in range(n):
        kind = int(rng.integers(8))
        if kind < 3:
            random_edit(studio, rng)
        elif kind == 3:
            studio.change("/api/settings", changes={"weights": {"pace": float(rng.uniform(0.0, 4.0))}})
        elif kind == 4:
            studio.change("/api/settings", changes={"seed": int(rng.integers(1000))})
        elif kind == 5:
            start_s = float(rng.uniform(2.0, duration_s - 8.0))
            body = {"revision": studio.state()["revision"], "from": start_s, "to": start_s + 4.0}
            studio.done(studio.ask("POST", "/api/alternatives", body))
        else:
            studio.ask("POST", f"/api/{('undo', 'redo')[kind - 6]}", {"revision": studio.state()["revision"]})
        studio.shown()
        if (i + 1) % max(1, n // 12) == 0:
            size_mb = studio.song.with_suffix(".studio.json").stat().st_size / 1e6
            print(f"  after {i + 1}: {studio.memory_mb():.0f} MB, project {size_mb:.1f} MB", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--db", type=Path, default=None)
    parser.add_argument("--seconds", type=float, nargs="*", default=[60.0, 180.0])
    parser.add_argument("--edits", type=int, default=100)
    parser.add_argument("--chains", type=int, default=100)
    parser.add_argument("--length", type=int, default=20)
    parser.add_argument("--hour", type=int, default=1200)
    parser.add_argument("--page", type=int, default=0, help="changes measured on the page, and frames")
    parser.add_argument("--changes", type=int, default=10, help="changes measured through the API")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    with TemporaryDirectory() as folder:
        for seconds in args.seconds:
            with running(Path(folder), seconds, args.db, args.seed) as studio:
                if args.changes:
                    times(studio, np.random.default_rng(args.seed), args.changes)
                if args.page:
                    page_times(studio, np.random.default_rng(args.seed), args.page)
                    frames(studio)
        if args.edits or args.chains or args.hour:
            with running(Path(folder), 40.0, args.db, args.seed) as studio:
                single_edits(studio, args.edits, np.random.default_rng(args.seed))
                chains(studio, args.chains, args.length, args.seed)
                hour(studio, args.hour, np.random.default_rng(args.seed))


if __name__ == "__main__":
    main()
