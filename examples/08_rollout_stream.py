"""Dance while a song plays: frames by the rollout network, steered by motifs, and how long each takes.

Run: OMP_NUM_THREADS=1 python examples/08_rollout_stream.py [SONG [REPERTOIRE [OUT.bvh]]]
"""

import sys
import time

import numpy as np

import choreograph as cg
from choreograph.exporters import save_motion

BLOCK = 2048  # samples at a time


def main(song: str = "", db: str = "", out: str = "stream.bvh") -> None:
    sound = cg.load_song(song or cg.example_songs()["house"])
    repertoire = cg.Repertoire.open(db) if db else cg.starter_repertoire()  # with a rollout network
    whole = cg.RolloutStream(sound, repertoire)  # only for its counts and its genre, which a DJ knows
    stream = cg.RolloutStream(whole.counts, repertoire, genre=whole.genre)
    frames, took_ms = [], []
    for start in range(0, len(sound.samples), BLOCK):  # a live program would wait for the sound card here
        stream.feed(sound.samples[start : start + BLOCK])
        began = time.perf_counter()
        for frame in stream:
            frames.append(frame)
            took_ms.append(1000 * (time.perf_counter() - began))
            if len(frames) == 300:
                stream.request(0, n_words=4)  # the most frequent motif
            began = time.perf_counter()
    root_pos_m, local_quat = (np.stack([getattr(f, n) for f in frames]) for n in ("root_pos_m", "local_quat"))
    save_motion(out, cg.Motion(stream.skeleton, root_pos_m, local_quat, stream.fps))
    median, p99, worst = np.percentile(took_ms, [50, 99, 100])
    print(f"{out}: {len(frames)} frames; ms each: mean {np.mean(took_ms):.2f}, median {median:.2f}, 99 % {p99:.2f}, worst {worst:.2f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
