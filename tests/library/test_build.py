"""Building a repertoire with its networks and words, from real takes: resumed, taken over, danced with."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_motions import stepping
from synthetic_repertoire import synthetic_takes, write_clicks

import choreograph as cg
from choreograph.core.counts import FROM_MOTION, make_counts, numbers_in_bar
from choreograph.core.errors import ParameterError
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.metrics import physical
from choreograph.evaluation.metrics.counts import counts_within
from choreograph.formats.register import save_motion
from choreograph.library.building.build import build_repertoire
from choreograph.library.building.counting import SURE_MOTION_CONFIDENCE
from choreograph.library.building.networks import PretrainedWeights
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.words import FEWEST_WORDS, segment_takes
from choreograph.library.builtin import pretrained_set
from choreograph.library.notes import Note
from choreograph.library.repertoire import starter_repertoire
from choreograph.motion.body import body_pos_m
from content.moves.genres import GENRES
from content.moves.sequencer import render_take

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("short_trainings")]

TRUE_BPM = 120.0
TAKES = ("DANCE_C_8", "DANCE_R_2", "DANCE_W_11")
LEARNED = BuildOptions(preset="tiny", density="learned")


@pytest.fixture(scope="module")
def takes(shared_data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("takes")
    for name in TAKES:
        (folder / name).symlink_to(shared_data / "dance-with-melody" / name)
    return folder


@pytest.mark.slow
def test_build_resume_reuse_and_dance(takes, tmp_path):
    progress = []
    built, _ = build_repertoire([takes], tmp_path / "a.h5", LEARNED, training_report=progress.append)
    assert set(built.net_names) == {"style", "motion_density", "music_density", "words"}
    assert built.density == "learned"
    assert built.vocabulary.genres == ("cha-cha", "rumba", "waltz", "all")
    assert set(built.vocabulary.word_take.tolist()) == {0, 1, 2}
    assert {take.credits.genre for take in built.takes} == {"cha-cha", "rumba", "waltz"}
    assert np.isfinite(built.clip_style).all()
    assert built.clip_style.std(axis=0).max() > 0.01  # a collapsed embedding would be constant
    assert {state.name for state in progress} == set(built.net_names)

    # Everything is trained: resuming only writes the file again, to the same bytes.
    first = built.path.read_bytes()
    again, _ = build_repertoire([takes], tmp_path / "a.h5", replace(LEARNED, resume=True))
    assert again.path.read_bytes() == first

    one, notes = build_repertoire(
        [takes], tmp_path / "b.h5", replace(LEARNED, init_from=built.path, leave_out=TAKES[1:])
    )
    assert any("used unchanged" in note for note in notes)
    assert set(one.net_names) == set(built.net_names)
    assert [take.name for take in one.takes] == [TAKES[0]]

    kept, _ = build_repertoire(
        [takes], tmp_path / "c.h5", BuildOptions(init_from=built.path, keep_networks=True, compress=True)
    )
    # Clips carry the analytic density there: its networks have nothing to do, and stay behind.
    assert set(kept.net_names) == {"style", "words"} and kept.density == "analytic"
    assert kept.provenance["trained_on"] == built.provenance["trained_on"]
    assert not (tmp_path / "c.h5.build").exists()
    assert kept.path.stat().st_size < 0.5 * built.path.stat().st_size
    # A compressed file has weights of 16 bits, which embed its clips.
    np.testing.assert_allclose(kept.clip_style, built.clip_style, atol=5e-4)
    np.testing.assert_array_equal(kept.vocabulary.word_motif, built.vocabulary.word_motif)

    # A take that is put in its own place again has the learned tempo-density, and all else that it had.
    learned = replace(LEARNED, init_from=built.path, keep_networks=True)
    at_once, _ = build_repertoire([takes], tmp_path / "d.h5", learned)
    before = at_once.path.read_bytes()
    cg.change_takes(at_once.path, replace=takes, leave_out=TAKES[:2])
    assert at_once.path.read_bytes() == before

    made = cg.dance(takes / "DANCE_W_11" / "audio.mp3", built, duration_s=12.0)
    assert abs(made.motion.n_frames - 12.0 * 60) <= 1


def test_two_takes_of_one_name_are_refused(takes, tmp_path):
    with pytest.raises(ParameterError, match="two takes are called"):
        build_repertoire([takes / TAKES[0], takes / TAKES[0]], tmp_path / "x.h5")
    assert not (tmp_path / "x.h5").exists()


def test_there_must_be_networks_to_keep(takes, tmp_path):
    with pytest.raises(ParameterError, match="init-from"):
        build_repertoire([takes], tmp_path / "x.h5", BuildOptions(keep_networks=True, pretrained="nothing"))


@pytest.fixture(scope="module")
def silent_takes(tmp_path_factory):
    """Two dances without music, of 40 words and more together, one take of 3 s, which has few."""
    folder = tmp_path_factory.mktemp("silent")
    for name, duration_s in (("long", 30.0), ("longer", 36.0), ("short", 3.0)):
        save_motion(folder / f"{name}.bvh", stepping(round(duration_s * 30), period_s=0.6, seed=1))
    return folder


@pytest.fixture(scope="module")
def of_silent_takes(silent_takes, short_trainings, tmp_path_factory):
    """What is built of them by default."""
    return build_repertoire(
        [silent_takes], tmp_path_factory.mktemp("built") / "a.h5", BuildOptions(preset="tiny")
    )


def farthest_from_s(vocabulary, words, times_s) -> float:
    """How far the border of a word is, at most, from the nearest of some times."""
    borders_s = np.concatenate([vocabulary.word_start_s[words], vocabulary.word_end_s[words]])
    return float(np.abs(borders_s[:, None] - times_s).min(axis=1).max())


def test_takes_without_music_have_words_on_their_counts(silent_takes, of_silent_takes, tmp_path):
    built, notes = of_silent_takes
    assert built.net_names == ("words",)
    vocabulary = built.vocabulary
    take = built.take_index("longer")
    words = vocabulary.words_of_take(take)
    assert len(words) > FEWEST_WORDS / 2
    counts = built.counts(take)
    assert counts.source == FROM_MOTION
    assert farthest_from_s(vocabulary, words, counts.times_s) < 1e-9
    assert vocabulary.genres == ("all",)
    assert any("fewer than two songs" in note for note in notes)

    # Networks to keep: the words' is there, so nothing is trained, and nothing is where training would be.
    kept, _ = build_repertoire(
        [silent_takes], tmp_path / "b.h5", BuildOptions(init_from=built.path, keep_networks=True)
    )
    assert not (tmp_path / "b.h5.build").exists()
    np.testing.assert_array_equal(kept.vocabulary.word_motif, vocabulary.word_motif)


def test_takes_without_counts_have_words_on_their_motion_beats(silent_takes, tmp_path):
    options = BuildOptions(preset="tiny", pretrained="nothing")
    built, _ = build_repertoire([silent_takes], tmp_path / "a.h5", options)
    take = built.take_index("longer")
    words = built.vocabulary.words_of_take(take)
    assert len(words) > FEWEST_WORDS / 2 and len(built.counts(take)) == 0
    assert farthest_from_s(built.vocabulary, words, built.motion_beats_s(take)) < 1e-9


def test_words_can_be_left_out(silent_takes, tmp_path):
    built, _ = build_repertoire([silent_takes], tmp_path / "a.h5", BuildOptions(preset="tiny", words=False))
    assert built.net_names == ()
    assert not built.has_vocabulary


@pytest.fixture(scope="module")
def takes_to_clicks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("clicks")
    for seed, (name, bpm) in enumerate({"slow": 90, "even": 110, "quick": 130}.items()):
        save_motion(folder / f"{name}.bvh", stepping(12 * 30, period_s=60 / bpm, seed=seed))
        write_clicks(folder / f"{name}.wav", duration_s=12.0, bpm=bpm)
    return folder


def test_density_networks_are_trained_on_request_only(takes_to_clicks, tmp_path):
    trained = []
    analytic, _ = build_repertoire(
        [takes_to_clicks], tmp_path / "a.h5", BuildOptions(preset="tiny", words=False),
        training_report=lambda state: trained.append(state.name),
    )  # fmt: skip
    assert set(trained) == {"style"} == set(analytic.net_names)
    assert analytic.density == "analytic"
    options = replace(LEARNED, words=False)
    learned, _ = build_repertoire([takes_to_clicks], tmp_path / "l.h5", options)
    assert set(learned.net_names) == {"style", "motion_density", "music_density"}
    assert learned.density == "learned"
    kept, _ = build_repertoire(
        [takes_to_clicks], tmp_path / "k.h5", replace(options, init_from=learned.path, keep_networks=True)
    )
    clips = np.arange(kept.n_clips)
    np.testing.assert_array_equal(kept.clip_motion.density(clips), learned.clip_motion.density(clips))
    assert not (tmp_path / "k.h5.build").exists()
    # What another repertoire lacks is trained: here the densities, beside the style that is kept.
    options = replace(options, init_from=analytic.path, keep_networks=True)
    beside, _ = build_repertoire([takes_to_clicks], tmp_path / "b.h5", options)
    np.testing.assert_array_equal(beside.clip_style, analytic.clip_style)
    assert beside.density == "learned"


def test_unknown_densities_are_refused():
    with pytest.raises(ParameterError, match="density among analytic, learned"):
        BuildOptions(density="guessed")


def test_songs_of_takes_that_only_words_were_trained_on_are_recorded(takes_to_clicks, tmp_path):
    own = {"even", "quick", "slow"}
    options = BuildOptions(pretrained="clean", keep_networks=True)
    shipped = set(pretrained_set("clean")["style"].trained_on)
    kept, _ = build_repertoire([takes_to_clicks], tmp_path / "kept.h5", options)
    assert set(kept.provenance["trained_on"]) == shipped and not own & shipped
    trained, _ = build_repertoire(
        [takes_to_clicks], tmp_path / "trained.h5", replace(options, train_words=True)
    )
    assert "words" in trained.net_names
    assert set(trained.provenance["trained_on"]) == shipped | own


def test_style_begins_with_the_shipped_networks(takes_to_clicks, tmp_path):
    """Of preset small. A build says which, and records what they were trained on."""
    options = BuildOptions(preset="small", words=False, pretrained="clean", style_changes={"steps": 2})
    begun = build_repertoire([takes_to_clicks], tmp_path / "begun.h5", options)
    assert any(note.startswith("training of style begins with the networks 'clean'") for note in begun.notes)
    trained_on = set(begun.repertoire.provenance["trained_on"])
    assert {"even", "quick", "slow", "house-01"} <= trained_on
    kept, _ = build_repertoire([takes_to_clicks], tmp_path / "kept.h5", replace(options, keep_networks=True))
    shipped = pretrained_set("clean")["style"].arrays
    for name, weight in shipped.weights.items():
        np.testing.assert_array_equal(kept.net("style").weights[name], weight)
    afresh, _ = build_repertoire(
        [takes_to_clicks], tmp_path / "afresh.h5", replace(options, pretrained="nothing")
    )
    assert set(afresh.provenance["trained_on"]) == {"even", "quick", "slow"}
    assert not np.allclose(kept.clip_style, afresh.clip_style, atol=1e-2)


def test_words_are_those_of_the_built_in_takes_unless_trained(silent_takes, tmp_path):
    options = BuildOptions(preset="small", pretrained="clean", keep_networks=True)
    shipped = starter_repertoire().net("words").weights
    kept, _ = build_repertoire([silent_takes], tmp_path / "kept.h5", options)
    assert all(np.array_equal(weight, shipped[name]) for name, weight in kept.net("words").weights.items())
    assert kept.has_vocabulary and not (tmp_path / "kept.h5.build" / "words.pt").exists()
    settings = {"preset": "small", "pretrained": "clean"}
    ways = {
        "begun": BuildOptions(**settings),
        "trained": BuildOptions(**settings, train_words=True),
        "nothing": BuildOptions(**(settings | {"pretrained": "nothing"})),
        "tiny": BuildOptions(**(settings | {"preset": "tiny"})),
    }
    begins = {
        name: PretrainedWeights.of(way, pretrained_set(way.pretrained)).weights("words") is not None
        for name, way in ways.items()
    }
    assert begins == {"begun": True, "trained": False, "nothing": False, "tiny": False}


def test_takes_without_music_have_the_style_of_the_shipped_networks(silent_takes, tmp_path):
    options = BuildOptions(preset="small", words=False, pretrained="clean")
    built, notes = build_repertoire([silent_takes], tmp_path / "a.h5", options)
    assert built.net_names == ("style",) and built.clip_style.any()
    assert any("used unchanged" in note for note in notes)


def test_mirror_augmentation_can_be_turned_off(silent_takes, of_silent_takes, tmp_path):
    options = BuildOptions(preset="tiny", augment_mirror=False)
    without, _ = build_repertoire([silent_takes], tmp_path / "a.h5", options)
    built, _ = of_silent_takes
    assert [each.net("words").config["mirrored_share"] for each in (built, without)] == [0.5, 0.0]


def test_what_a_kept_repertoire_lacks_is_trained(silent_takes, of_silent_takes, tmp_path):
    old = of_silent_takes.repertoire
    with_old = BuildOptions(
        preset="tiny", init_from=old.path, keep_networks=True, leave_out=("long", "longer")
    )
    few, _ = build_repertoire([silent_takes], tmp_path / "few.h5", with_old)
    assert few.net_names == (
        "words",
    )  # taken over, with its motifs, though there are too few words to find any
    motifs, kept = old.vocabulary.motifs, few.vocabulary.motifs
    assert len(few.vocabulary.word_motif) < FEWEST_WORDS
    same = np.flatnonzero((motifs.embeddings[:, None] == kept.embeddings).all(axis=2))
    assert len(same) == len(kept) < len(motifs)  # those that its take dances, in their order
    [take] = [old.take_index(take.name) for take in few.takes]
    its_motifs = old.vocabulary.word_motif[old.vocabulary.words_of_take(take)]
    np.testing.assert_array_equal(kept.embeddings[few.vocabulary.word_motif], motifs.embeddings[its_motifs])
    lacking, notes = build_repertoire(
        [silent_takes], tmp_path / "none.h5", BuildOptions(preset="tiny", leave_out=("long", "longer"))
    )
    assert lacking.net_names == () and not lacking.has_vocabulary
    assert any(f"fewer than {FEWEST_WORDS}" in note for note in notes)
    trained, _ = build_repertoire(
        [silent_takes], tmp_path / "c.h5", replace(with_old, init_from=lacking.path, leave_out=())
    )
    assert trained.net_names == ("words",)
    assert (tmp_path / "c.h5.build" / "words.pt").exists()


def test_takes_are_segmented_on_their_part_of_the_song(tmp_path):
    song = write_clicks(tmp_path / "clicks.wav", duration_s=25.0, bpm=TRUE_BPM)
    [synthetic] = synthetic_takes(periods_s=[0.75], duration_s=12.0)
    cases = {
        "begins 3.2 s into the song": dict(song_path=song, song_start_s=3.2),
        "begins after the song": dict(song_path=song, song_start_s=40.0),
        "no music": {},
    }
    takes = [
        replace(synthetic, take=replace(synthetic.take, name=name, **changes))
        for name, changes in cases.items()
    ]
    (inside, after, silent), notes = segment_takes(takes)
    clicks_s = np.arange(0.0, 25.0, 60.0 / TRUE_BPM) - 3.2
    assert len(inside.words) >= 20
    assert np.abs(inside.words.start_s[:, None] - clicks_s).min(axis=1).max() < 0.05
    for cut in (after, silent):
        assert np.abs(cut.words.start_s[:, None] - synthetic.motion_beats_s).min(axis=1).max() < 1e-9
    assert notes == [Note("no music beats", "begins after the song")]


def test_takes_with_counts_are_segmented_on_them_whatever_their_song_says(tmp_path):
    song = write_clicks(tmp_path / "clicks.wav", duration_s=25.0, bpm=TRUE_BPM)
    [synthetic] = synthetic_takes(periods_s=[0.75], duration_s=12.0)
    counts = make_counts(np.arange(1.1, 11.0, 0.7), numbers_in_bar(15, 4), 4, source="annotation")
    [cut], notes = segment_takes(
        [replace(synthetic, take=replace(synthetic.take, song_path=song, counts=counts))]
    )
    np.testing.assert_allclose(cut.words.start_s, counts.times_s[:-1])
    assert not notes


@pytest.fixture(scope="module")
def waltz(shared_data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("waltz")
    (folder / "DANCE_W_11").symlink_to(shared_data / "dance-with-melody" / "DANCE_W_11")
    return folder


def test_feet_of_takes_are_locked_by_default(waltz, tmp_path):
    def built(name, **changes):
        options = BuildOptions(preset="tiny", words=False, **changes)
        return build_repertoire([waltz], tmp_path / name, options)[0]

    locked, recorded = built("locked.h5"), built("recorded.h5", lock_feet=False)
    assert (locked.provenance["feet_locked"], recorded.provenance["feet_locked"]) == (True, False)
    (still, _), (sliding, _) = locked.motion(0), recorded.motion(0)
    slides = [physical.foot_slide_cm_s(body_pos_m(motion), motion.fps) for motion in (still, sliding)]
    assert slides[0] < 0.85 * slides[1]
    # Only legs are moved; features are measured on the locked motion.
    np.testing.assert_allclose(still.root_pos_m, sliding.root_pos_m, atol=1e-6)
    arms = slice(still.skeleton.index("neck"), None)
    np.testing.assert_allclose(still.local_quat[:, arms], sliding.local_quat[:, arms], atol=1e-6)
    coarse = body_pos_m(still.resampled(NET_FPS))
    np.testing.assert_allclose(
        locked.body_pos_m(0)[: len(coarse)], coarse[: len(locked.body_pos_m(0))], atol=2e-3
    )
    again = built("again.h5")
    assert again.path.read_bytes() == locked.path.read_bytes()


def test_takes_without_music_are_counted_by_their_motion(tmp_path):
    """By the shipped networks, unless none are wanted; the repertoire says so."""
    folder = tmp_path / "takes"
    folder.mkdir()
    beats_s = 0.3 + 0.48 * np.arange(40)
    save_motion(folder / "a.bvh", render_take(GENRES["disco"], beats_s, seed=126, fps=30.0).motion)
    options = BuildOptions(preset="tiny", words=False)
    built = build_repertoire([folder], tmp_path / "a.h5", options)
    counts = built.repertoire.counts(0)
    assert counts.source == FROM_MOTION and counts.confidence >= SURE_MOTION_CONFIDENCE
    assert counts_within(counts.times_s, beats_s) > 0.95
    assert len(counts.uncertainty) == len(counts) and counts.uncertainty.mean() < 0.1
    assert f"a: counts are estimated from the motion, confidence {counts.confidence:.2f}" in built.notes
    assert any("estimated from motion by the networks 'research'" in note for note in built.notes)
    assert built.repertoire.provenance["pretrained"] == "default"
    without = build_repertoire([folder], tmp_path / "b.h5", replace(options, pretrained="nothing"))
    assert not len(without.repertoire.counts(0))
