"""The rollout engine: built, danced, constrained, refused."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from command_line import run
from synthetic_repertoire import synthetic_repertoire, write_clicks

import choreograph as cg
from choreograph.choreography.enforcement import danced_motifs
from choreograph.choreography.rollout import engine as rollout
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.library.building.build import build_repertoire
from choreograph.library.building.options import BuildOptions
from choreograph.music.rhythm import rhythm_from, word_spectra
from choreograph.music.song import Song
from choreograph.pipeline import planning

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rolled(rolling, song):
    return cg.dance(song, rolling, engine="rollout")


def test_a_build_stores_the_network_and_its_configuration(rolling):
    assert set(rolling.net_names) == {"words", "rollout"}
    assert rolling.rollout_net().config.n_joints == rolling.skeleton.n_joints


def test_a_network_that_is_kept_is_not_trained_again(rolling, tmp_path):
    reported = []
    kept, _ = build_repertoire(
        [rolling.path.parent], tmp_path / "b.h5",
        BuildOptions(preset="tiny", rollout=True, init_from=rolling.path, keep_networks=True),
        training_report=reported.append,
    )  # fmt: skip
    assert not reported
    for name, weights in rolling.net("rollout").weights.items():
        assert np.array_equal(weights, kept.net("rollout").weights[name])


def test_a_rollout_fills_its_song_with_words(rolled):
    plan = rolled.plan
    assert (plan.engine, plan.seconds) == ("rollout", ())
    assert abs(rolled.motion.duration_s - plan.duration_s) <= 1 / 60
    assert plan.words[0].start_s == 0.0 and plan.words[-1].end_s == pytest.approx(plan.duration_s)
    assert {word.take for word in plan.words} == {""}
    assert cg.Plan.from_json(plan.to_json()) == plan


def test_one_seed_one_dance(rolling, song, rolled):
    again = cg.dance(song, rolling, engine="rollout")
    assert np.array_equal(again.motion.local_quat, rolled.motion.local_quat)


def test_given_and_pinned_motifs_are_planned(rolling, song):
    given = cg.dance(song, rolling, engine="rollout", motifs=[1, 0, 1])
    assert [word.motif for word in given.plan.words[:3]] == [1, 0, 1]
    pinned = cg.dance(song, rolling, engine="rollout", pins=[cg.MotifPin(4.1, 1)])
    word = next(w for w in pinned.plan.words if w.start_s <= 4.1 < w.end_s)
    assert (word.motif, word.pinned) == (1, True)
    banned = cg.dance(song, rolling, engine="rollout", bans=[cg.Ban(motif=0)])
    assert all(word.motif != 0 for word in banned.plan.words)


@pytest.mark.parametrize("motif", [0, 1])
def test_what_is_said_of_a_pin_is_what_is_danced(rolling, song, motif):
    made = cg.dance(song, rolling, engine="rollout", pins=[cg.MotifPin(4.1, motif)])
    bounds_s = np.array([*(word.start_s for word in made.plan.words), made.plan.words[-1].end_s])
    slot = int(np.searchsorted(bounds_s, 4.1, "right")) - 1
    assert (danced_motifs(made.motion, bounds_s, rolling)[slot] == motif) == (not made.unmet)
    assert set(made.unmet) <= set(made.notes)


def test_a_pin_that_is_not_danced_is_tried_again_and_held_longer(rolling, song, rolled, monkeypatch):
    before = next(word for word in rolled.plan.words if word.start_s > 3.5)
    pinned = 1 - before.motif  # the motif that would not be danced there
    shown, asked = [before.motif, pinned], []

    def generated(request, constraints, motifs, embeddings, music):
        asked.append(motifs)
        return request.repertoire.motion(0)[0]

    monkeypatch.setattr(
        rollout, "motifs_of_embeddings", lambda embeddings, _: np.full(len(embeddings), shown.pop(0))
    )
    monkeypatch.setattr(rollout, "without_distant", lambda danced, *_: danced)
    monkeypatch.setattr(rollout, "_generated", generated)
    made = cg.dance(song, rolling, engine="rollout", pins=[cg.MotifPin(before.end_s + 0.1, pinned)])
    assert made.unmet == () and len(asked) == 2
    slot = next(i for i, word in enumerate(made.plan.words) if word.pinned)
    assert asked[1][slot - 1 : slot + 2].tolist() == [pinned] * 3
    assert [word.motif for word in made.plan.words] == asked[1].tolist()


def test_what_no_try_dances_is_said_in_one_line(rolling, song, monkeypatch):
    monkeypatch.setattr(rollout, "motifs_of_embeddings", lambda embeddings, _: np.full(len(embeddings), -1))
    pinned = cg.dance(song, rolling, engine="rollout", pins=[cg.MotifPin(4.1, 1)])
    assert len(pinned.unmet) == 1
    assert re.match(r"expected motif 1, but the network dances no motif at 4\.\d s", pinned.unmet[0])
    given = cg.dance(song, rolling, engine="rollout", motifs=[1, 0, 1, 1, 0])
    assert len(given.unmet) == 1 and "expected 5 motifs as given" in given.unmet[0]


@pytest.mark.parametrize("motif", [0, 1])
def test_a_pin_that_the_network_never_dances_is_laid_over_from_a_take(rolling, song, motif, monkeypatch):
    bounds_s = word_bounds_s(cg.dance(song, rolling, engine="rollout"))
    slot = len(bounds_s) // 2
    medoid = int(rolling.vocabulary.motifs.words[1 - motif])
    start_s = float(rolling.vocabulary.word_start_s[medoid])

    def generated(*asked):
        """The other motif over and over, whatever is asked."""
        beat_s = float(bounds_s[slot + 1] - bounds_s[slot])
        frames = np.arange(0, bounds_s[-1], 1 / 60) % beat_s
        return rolling.motion(0)[0].sampled((start_s + frames) * rolling.motion(0)[0].fps, fps=60.0)

    monkeypatch.setattr(rollout, "_generated", generated)
    at_s = float(bounds_s[slot : slot + 2].mean())
    made = cg.dance(song, rolling, engine="rollout", pins=[cg.MotifPin(at_s, motif)])
    assert made.unmet == ()
    assert danced_motifs(made.motion, bounds_s, rolling)[slot] == motif
    word = made.plan.words[slot]
    assert (word.take, word.motif, word.pinned) == ("steps", motif, True)
    assert {w.take for w in made.plan.words if w is not word} == {""}
    assert made.motion.n_frames == round(made.plan.duration_s * 60)


def test_a_given_motif_that_is_missed_is_asked_for_beyond_its_medoid(rolling, song, monkeypatch):
    medoids, asked = rolling.vocabulary.motifs.embeddings, []
    missed = medoids[0] + 0.1 * (medoids[0] - medoids[1])  # of motif 0, whatever the training came to

    def generated(request, constraints, motifs, embeddings, music):
        asked.append(embeddings)
        return rolling.motion(0)[0]

    monkeypatch.setattr(rollout, "_generated", generated)
    monkeypatch.setattr(
        planning, "danced_embeddings", lambda motion, bounds_s, _: np.tile(missed, (len(bounds_s) - 1, 1))
    )
    made = cg.dance(song, rolling, engine="rollout", motifs=[1] * 6)
    inner = [slot for slot in range(2, 5) if made.plan.words[slot].start_s >= made.plan.opening_s]
    for slot in inner:
        assert np.allclose(asked[0][slot], medoids[1])
        assert np.allclose(asked[1][slot], medoids[1] + (medoids[1] - missed), atol=1e-5)
        assert np.allclose(
            asked[2][slot], medoids[1] + (medoids[1] - missed) / 2, atol=1e-5
        )  # no better: less


def word_bounds_s(dance):
    return np.array([*(word.start_s for word in dance.plan.words), dance.plan.words[-1].end_s])


def test_strict_writes_nothing_that_is_not_as_asked(rolling, song, monkeypatch, tmp_path):
    monkeypatch.setattr(rollout, "motifs_of_embeddings", lambda embeddings, _: np.full(len(embeddings), -1))
    out = tmp_path / "a.bvh"
    asked = ("dance", song, "--db", rolling.path, "--engine", "rollout", "--pin", "4.1=motif:1", "-o", out)
    strict = run(*asked, "--strict")
    assert strict.exit_code == 2 and "expected motif 1" in strict.output and not out.exists()
    lenient = run(*asked)
    assert lenient.exit_code == 0 and "expected motif 1" in lenient.output and out.exists()


def test_another_songs_style_changes_poses_but_not_motifs(rolling, song, rolled, tmp_path):
    other = write_clicks(tmp_path / "other.wav", duration_s=5.0, bpm=90.0)
    styled = cg.dance(song, rolling, engine="rollout", style_song=other)
    assert [w.motif for w in styled.plan.words] == [w.motif for w in rolled.plan.words]
    assert not np.allclose(styled.motion.local_quat, rolled.motion.local_quat)


def test_constraints_on_takes_are_refused_in_one_line(rolling, song, tmp_path):
    with pytest.raises(ParameterError, match="dances no take"):
        cg.dance(song, rolling, engine="rollout", pins=[cg.TakePin(1.0, 2.0, "steps")])
    with pytest.raises(ParameterError, match="style song"):
        cg.dance(song, rolling, engine="mixer", style_song=song)
    without = synthetic_repertoire(tmp_path / "rep.h5", vocabulary=True)
    with pytest.raises(RepertoireError, match="build-db --rollout"):
        cg.dance(song, without, engine="rollout")


def test_words_outside_the_song_have_the_music_of_the_nearest():
    samples = np.random.default_rng(0).normal(0, 0.1, 22050 * 4).astype(np.float32)
    noise = Song(samples, "noise")
    spectra = word_spectra(noise, np.array([-1.0, -0.5, 0.5, 1.0, 3.9, 4.5, 5.0]))
    inside = word_spectra(noise, np.array([0.0, 0.5, 1.0, 3.9, 4.0]))
    assert np.allclose(spectra[0], inside[0]) and np.allclose(spectra[1], inside[0])
    assert np.allclose(spectra[-1], inside[-1]) and len(spectra) == 6
    beats = np.arange(0.0, 4.0, 0.5)
    whole = rhythm_from(noise, beats, 0.0)
    assert np.array_equal(rhythm_from(noise, beats, 1.0), whole[30:])
    early = rhythm_from(noise, beats, -0.5)
    assert len(early) == len(whole) + 15 and np.array_equal(early[15:], whole)
    assert len(rhythm_from(replace(noise, name="x"), beats, 60.0)) == 1
