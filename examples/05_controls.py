"""Choose what is danced: a genre, a pinned motif, a pinned take, a ban, and the motifs of another dance.

Run: python examples/05_controls.py [SONG [REPERTOIRE]]
"""

import sys

import choreograph as cg


def main(song: str = "", db: str = "") -> None:
    song = song or cg.example_songs()["house"]
    rep = cg.Repertoire.open(db) if db else cg.starter_repertoire()
    take, banned = rep.takes[0], rep.takes[-1].name
    motif = cg.motifs_of(take.name, rep)[0]

    mixed = cg.dance(
        song, rep, engine="mixer", genre=take.credits.genre, duration_s=6.0, bans=[cg.Ban(take=banned)],
        pins=[cg.MotifPin(1.5, motif), cg.TakePin(3.0, 5.0, take.name)],
    )  # fmt: skip
    mixed.save("controlled.bvh")
    for word in mixed.plan.words:
        print(f"{word.start_s:5.2f} s: motif {word.motif:3d} of {word.take}{', pinned' * word.pinned}")
    assert banned not in mixed.plan.takes_s()

    again = cg.dance(song, rep, motifs=cg.motifs_of(take.name, rep), duration_s=6.0)
    print(f"{take.name} again: motifs", *(word.motif for word in again.plan.words))

    first, second = cg.vary(song, rep, 2, engine="mixer", duration_s=6.0)
    different = sum(a.take != b.take for a, b in zip(first.plan.words, second.plan.words, strict=True))
    print(f"two variations: {different} of {len(first.plan.words)} words are of different takes")


if __name__ == "__main__":
    main(*sys.argv[1:])
