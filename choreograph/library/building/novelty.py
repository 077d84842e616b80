"""How far takes that are added to a repertoire are from those that its networks were trained on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from choreograph.core.numerics import AnyFloats, Floats, Indices, squared_distances
from choreograph.library.building.kept_motifs import KeptMotifs, WordTable, embedder_of
from choreograph.library.notes import Note
from choreograph.library.repertoire import Repertoire

MOST = 400  # words or clips of either side that are compared, evenly spaced
_MOST_TAKES = 32  # whose words are compared, since bodies are read take by take
_SHARE = 0.95  # of what the networks were trained on, which is nearer than what counts as far


def novelty_notes(
    repertoire: Repertoire,
    genres: Sequence[str],
    style: AnyFloats,
    words: WordTable,
    bodies: Sequence[AnyFloats],
) -> list[Note]:
    """At most one note on distances, and one on new genres.

    Parameters
    ----------
    repertoire : without the new takes
    genres : of the new takes
    style : float array (N, 32)   style vectors of the new clips
    words : of the new takes, perhaps none
    bodies : float arrays (T, 21, 3)   body positions of the new takes at 20 fps

    Motion words are compared by their distance from the nearest motif. Without motifs, clips are compared by
    the distance of their style from that of the nearest clip of another take.
    """
    trained = _trained_takes(repertoire)
    notes = []
    if repertoire.has_vocabulary and len(words.take):
        new_m, known_m = _word_distances_m(repertoire, trained, words, bodies)
        notes.append(_note("farther words", new_m, known_m))
    elif len(style) and "style" in repertoire.net_names:
        new, known = _clip_distances(repertoire, trained, style)
        notes += [_note("farther clips", new, known)] if len(known) else []
    known_genres = {repertoire.takes[take].credits.genre for take in trained.tolist()}
    unknown = sorted(set(genres) - known_genres - {""})
    if unknown and repertoire.net_names:
        notes.append(Note("new genres", values={"genres": ", ".join(unknown), "name": repertoire.path.name}))
    return notes


def _note(kind: str, new: Floats, known: Floats) -> Note:
    share = float((new > np.quantile(known, _SHARE)).mean())
    medians = {"new": float(np.median(new)), "known": float(np.median(known))}
    return Note(kind, values={"share": share, **medians})


def _trained_takes(repertoire: Repertoire) -> Indices:
    """The takes to songs that the networks were trained on, or all takes if there are none of these."""
    songs = set(repertoire.provenance.get("trained_on", ()))
    trained = [index for index, take in enumerate(repertoire.takes) if take.song_name in songs]
    return np.array(trained or range(len(repertoire.takes)), np.int64)


def _some(indices: Indices, most: int = MOST) -> Indices:
    """At most `most` of the indices, evenly spaced."""
    at = np.linspace(0, len(indices) - 1, min(most, len(indices))).round().astype(np.int64)
    some: Indices = indices[at]
    return some


def _word_distances_m(
    repertoire: Repertoire, trained: Indices, words: WordTable, bodies: Sequence[AnyFloats]
) -> tuple[Floats, Floats]:
    """Distances in metres from the nearest motif: of new words, and of words of the takes before."""
    motifs, embed = KeptMotifs.of(repertoire), repertoire.word_net().embed
    before = repertoire.vocabulary
    table = WordTable(before.word_take, before.word_start_s, before.word_end_s, (), ())
    takes = _some(np.intersect1d(before.word_take, trained), _MOST_TAKES)
    known = _some(np.flatnonzero(np.isin(before.word_take, takes)))
    of_known = embedder_of(table, repertoire.body_pos_m, embed)(known)
    of_new = embedder_of(words, bodies.__getitem__, embed)(_some(np.arange(len(words.take))))
    return motifs.distances_m(of_new), motifs.distances_m(of_known)


def _clip_distances(repertoire: Repertoire, trained: Indices, style: AnyFloats) -> tuple[Floats, Floats]:
    """Distances of style from the nearest clip of another take: of new clips, and of clips before."""
    kept, take = repertoire.clip_style, repertoire.clip_take
    known = _some(np.flatnonzero(np.isin(take, trained)))
    to_known = squared_distances(kept[known].astype(np.float64), kept.astype(np.float64))
    to_known[take[known][:, None] == take] = np.inf
    nearest = to_known.min(axis=1)
    new = np.asarray(style, np.float64)[_some(np.arange(len(style)))]
    to_new = squared_distances(new, kept.astype(np.float64)).min(axis=1)
    return np.sqrt(to_new), np.sqrt(nearest[np.isfinite(nearest)])
