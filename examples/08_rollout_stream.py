"""Dance while a song plays: frames by the rollout network, steered by motifs, and how long each takes.

Run: OMP_NUM_THREADS=1 python examples/08_rollout_stream.py [SONG [REPERTOIRE [OUT.bvh]]]
"""

import sys
import time

import numpy as np

import choreograph as cg
from choreograph.formats.register import save_motion


def main(song: str = "", db: str = "", out: str = "stream.bvh") -> None:
    sound = cg.load_song(song or cg.example_songs()["house"])
    repertoire = cg.Repertoire.open(db) if db else cg.starter_repertoire()  # with a rollout network
    counts = cg.RolloutStream(sound, repertoire).counts  # known from the start, as to a DJ
    stream = cg.RolloutStream(counts, repertoire)
    frames, took_ms = [], []
    for start in range(0, len(sound.samples) + 2048, 2048):
        # A live program would wait for the sound card here.
        block = sound.samples[start : start + 2048]
        stream.feed(block) if len(block) else stream.finish()
        began = time.perf_counter()
        for frame in stream:
            frames.append(frame)
            took_ms.append(1000 * (time.perf_counter() - began))
            if len(frames) == 300:
                stream.request(0, n_words=4)  # the most frequent motif
            began = time.perf_counter()
    root_pos_m, local_quat = (np.stack([getattr(f, n) for f in frames]) for n in ("root_pos_m", "local_quat"))
    save_motion(out, cg.Motion(stream.skeleton, root_pos_m, local_quat, stream.fps))
    shown = ", ".join(f"{p} %: {np.percentile(took_ms, p):.2f}" for p in (50, 99, 100))
    print(f"{out}: {len(frames)} frames, ms each: mean {np.mean(took_ms):.2f}, {shown}")


if __name__ == "__main__":
    main(*sys.argv[1:])
