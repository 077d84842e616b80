"""Dances to a song of planted form: phrases return with the music, unless something stronger is requested."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import (
    synthetic_repertoire,
    synthetic_takes,
    with_counts,
    write_clicks,
)

import choreograph as cg
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.counts import numbers_in_bar
from choreograph.evaluation.metrics import structure
from choreograph.music.form import Form, Phrase
from choreograph.pipeline.published import WEIGHTS

pytestmark = pytest.mark.slow

BPM = 110.0
BEAT_S = 60.0 / BPM
LETTERS = "ABA"
PHRASE_S = 16 * BEAT_S  # no whole number of seconds
PERIODS_S = (0.45, 0.5, 0.55, 0.6)


@pytest.fixture(scope="module")
def song(tmp_path_factory):
    """A song of clicks, and a file of its beats."""
    folder = tmp_path_factory.mktemp("songs")
    path = write_clicks(folder / "clicks.wav", duration_s=3 * PHRASE_S + 1.0, bpm=BPM)
    times_s = BEAT_S * np.arange(3 * 16 + 1)
    numbers = numbers_in_bar(len(times_s), 4)
    lines = [f"{at_s:.6f} {number}" for at_s, number in zip(times_s, numbers, strict=True)]
    (folder / "beats.txt").write_text("\n".join(lines), encoding="utf-8")
    return path, folder / "beats.txt"


@pytest.fixture(scope="module", params=["counted", "uncounted"])
def repertoire(request, tmp_path_factory):
    takes = synthetic_takes(periods_s=PERIODS_S, duration_s=24.0)
    if request.param == "counted":
        takes = with_counts(takes, PERIODS_S)
    return synthetic_repertoire(tmp_path_factory.mktemp(request.param) / "rep.h5", takes)


@pytest.fixture(scope="module")
def dance(song, repertoire):
    """Dances to the song with the form ABA, or with another one, each made once."""
    path, beats = song
    made: dict[str, cg.Dance] = {}

    def danced(letters: str = LETTERS, **settings) -> cg.Dance:
        phrases = tuple(
            Phrase(
                i * PHRASE_S, (i + 1) * PHRASE_S, 16, i, letters.index(x) if letters.index(x) < i else None
            )
            for i, x in enumerate(letters)
        )

        def planted(*given, **keywords):
            features, notes = analyse_song(*given, **keywords)
            return replace(features, form=Form(phrases)), notes

        asked = f"{letters} {settings}"
        if asked not in made:
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr("choreograph.pipeline.dancing.analyse_song", planted)
                made[asked] = cg.dance(path, repertoire, beats=beats, hold_ends=False, **settings)
        return made[asked]

    return danced


def returned_share(dance: cg.Dance) -> float:
    blocks = dance.plan.blocks
    pieces_s = np.array([(b.start_s, b.end_s, b.source_start_s, b.source_end_s) for b in blocks])
    starts_s = PHRASE_S * np.arange(3)
    shares = structure.same_shares(
        [block.planned.take for block in blocks], pieces_s, np.stack([starts_s, starts_s + PHRASE_S], axis=1)
    )
    return structure.return_mean(shares, LETTERS)


def test_a_phrase_returns_with_the_music(dance, repertoire):
    """Takes without counts are warped anew from another fraction of a beat, and return less often."""
    least = 0.75 if len(repertoire.counts(0)) else 0.5
    returning, medleys = dance(), [dance(weights={"form": 0.0}, seed=seed) for seed in (0, 1)]
    assert returned_share(returning) >= least
    assert min(map(returned_share, medleys)) <= 0.3  # with few takes, one of three returns by chance
    assert "form" not in dance("ABC").plan.weights
    booked = {second.costs["form"] for second in returning.plan.seconds}
    assert booked <= {0.0, 2.0, 4.0}
    assert all(second.costs["form"] == 0.0 for second in returning.plan.seconds if second.second < 17)


def test_weight_0_dances_as_without_form(dance):
    without, new = dance(weights={"form": 0.0}), dance("ABC")
    assert [s.source_times_s for s in without.plan.seconds] == [s.source_times_s for s in new.plan.seconds]
    assert np.array_equal(without.motion.local_quat, new.motion.local_quat)


def test_pins_and_bans_are_stronger(dance):
    first = dance().plan.seconds[3].take
    pinned = cg.TakePin(20.0, 24.0, next(f"take{i}" for i in range(4) if f"take{i}" != first))
    made = dance(pins=[pinned], weights={"form": 50.0})
    assert {second.take for second in made.plan.seconds[20:24]} == {pinned.take}
    banned = dance(bans=[cg.Ban(take=first)], weights={"form": 50.0})
    assert first not in {second.take for second in banned.plan.seconds}


def test_a_gap_does_not_return_to_kept_parts(dance):
    """What is planned beside the kept parts is not danced, so that the weight of the form changes nothing."""
    keep = [cg.Keep(0.0, 2 * PHRASE_S)]
    filled = [dance(existing=dance(), keep=keep, weights={"form": weight}) for weight in (0.0, 50.0)]
    assert filled[0].plan.edits == filled[1].plan.edits
    assert np.array_equal(filled[0].motion.local_quat, filled[1].motion.local_quat)


def test_the_method_as_published_has_no_form():
    assert WEIGHTS["form"] == 0.0
