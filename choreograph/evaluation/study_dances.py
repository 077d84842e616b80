"""The dances of a rating study: one per variant and held-out song, and the real ones."""

from __future__ import annotations

from collections.abc import Sequence

from choreograph.evaluation.results import REAL
from choreograph.evaluation.songs import EvaluatedSong, check_unseen
from choreograph.evaluation.study import StudyDance
from choreograph.evaluation.variants import Variant, dance_variant
from choreograph.progress import ProgressReport
from choreograph.repertoire import Repertoire


def make_study_dances(
    repertoire: Repertoire,
    songs: Sequence[EvaluatedSong],
    variants: Sequence[Variant],
    *,
    seen: bool = False,
    report: ProgressReport | None = None,
) -> dict[str, list[StudyDance]]:
    """Dances to every song by variant, with seed 0; songs with a real dance add the variant `REAL`.

    Raises as `evaluate` does: `ParameterError` if the repertoire was built from a song, unless `seen`.
    """
    if not seen:
        check_unseen(songs, repertoire)
    dances: dict[str, list[StudyDance]] = {variant.name: [] for variant in variants}
    n_dances = len(songs) * len(variants)
    for number, song in enumerate(songs):
        loaded = song.load()
        for done, variant in enumerate(variants, start=number * len(variants)):
            if report is not None:
                report("dancing", done, n_dances)
            dance = dance_variant(variant, loaded, repertoire)
            dances[variant.name].append(StudyDance(dance.motion, song.path, song.start_s, song.genre))
        if song.take is not None:
            motion = song.take.motion
            motion = motion.sliced(0, max(1, min(motion.n_frames, round(loaded.duration_s * motion.fps))))
            dances.setdefault(REAL, []).append(StudyDance(motion, song.path, song.start_s, song.genre))
    return dances
