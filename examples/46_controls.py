"""Saying what is danced: a genre, a pinned motif, a pinned take, a ban, and a dance made again.

Run: python examples/46_controls.py SONG REPERTOIRE OUT.bvh
"""

import sys

import choreograph as cg


def main(song: str, db: str, out: str) -> None:
    rep = cg.Repertoire.open(db)
    genre, motif = rep.takes[0].credits.genre, int(rep.vocabulary.word_motif[0])
    take, banned = rep.takes[0].name, rep.takes[-1].name

    mixed = cg.dance(
        song, rep, engine="mixer", genre=genre,
        pins=[cg.MotifPin(1.5, motif), cg.TakePin(3.0, 5.0, take)], bans=[cg.Ban(take=banned)],
    )  # fmt: skip
    mixed.save(out)
    for word in mixed.plan.words[:8]:
        print(f"{word.start_s:5.2f} s: motif {word.motif:3d} of {word.take}{', pinned' * word.pinned}")
    assert banned not in mixed.plan.takes_s()

    graph = cg.dance(song, rep, pins=[cg.MotifPin(1.5, motif)])  # the graph dances it, too
    print(f"graph: {len(graph.plan.seconds)} seconds, {len(graph.plan.words)} words in their place")

    again = cg.dance(song, rep, motifs=cg.motifs_of(take, rep))  # the moves of a take, to this song
    print(f"{take} again: motifs {', '.join(str(word.motif) for word in again.plan.words[:8])}, …")


if __name__ == "__main__":
    main(*sys.argv[1:])
