"""The method as published: its settings reach the networks, the warper, the graph and the rendering."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from synthetic_motions import stepping
from synthetic_repertoire import (
    synthetic_contents,
    synthetic_repertoire,
    synthetic_takes,
    with_counts,
    write_clicks,
)

import choreograph as cg
from choreograph.choreography.graph import engine, segments
from choreograph.choreography.graph.costs import DEFAULT_WEIGHTS
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.evaluation.run import dance_variant
from choreograph.formats.register import import_takes, save_motion
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import poses_at
from choreograph.library.writing import write_repertoire
from choreograph.motion.body import clips_to_root_frame
from choreograph.music.song_features import motion_density
from choreograph.nets.configs import DensityConfig, StyleConfig
from choreograph.nets.density import MotionDensity
from choreograph.pipeline import published
from choreograph.plan.joins import take_motions
from choreograph.plan.runs import plan_runs
from choreograph.render.assembly import assemble
from research.swapped_net import ablated_nets
from research.train_rollout_ablations import train
from research.variants import VARIANTS, variants_named

pytestmark = pytest.mark.slow

BPMS = {"slow": 90, "even": 110, "quick": 130}


@pytest.fixture(scope="module")
def takes(tmp_path_factory):
    """Three takes of 16 s that step to clicks."""
    folder = tmp_path_factory.mktemp("takes")
    for seed, (name, bpm) in enumerate(BPMS.items()):
        save_motion(folder / f"{name}.bvh", stepping(16 * 30, period_s=60 / bpm, seed=seed))
        write_clicks(folder / f"{name}.wav", duration_s=16.0, bpm=bpm)
    return folder


@pytest.fixture(scope="module")
def built(takes, tmp_path_factory):
    """Their repertoire by `build-db --published`, of which 2 epochs are 2 steps."""
    options = published.published_build("tiny")
    for changes in ("style_changes", "density_changes"):
        options[changes] = options[changes] | {"epochs": 2}
    steps = {}
    made = cg.build(
        [takes], tmp_path_factory.mktemp("built") / "p.h5", words=False, **options,
        training_report=lambda state: steps.update({state.name: state.n_steps}),
    )  # fmt: skip
    return made.repertoire, steps


@pytest.fixture(scope="module")
def made(built, song):
    return cg.dance(song, built[0], config=published.published_dance())


def test_the_networks_are_trained_as_published(built):
    repertoire, steps = built
    assert steps == {"style": 2, "motion_density": 2, "music_density": 2}
    style = StyleConfig(**_with_tuples(repertoire.net("style").config))
    assert (style.loss, style.music_inputs) == ("paper", "mel")
    assert (style.batch_size, style.learning_rate, style.weight_decay, style.schedule) == (
        16, 1e-4, 0.0, "constant",
    )  # fmt: skip
    assert not (style.normalised or style.augmented or style.balanced_genres or style.dropout)
    weights = repertoire.net("style").weights
    assert not [name for name in weights if name.startswith("music.rhythm") or ".spread" in name]
    for name in ("motion_density", "music_density"):
        density = DensityConfig(**_with_tuples(repertoire.net(name).config))
        assert density.loss == "paper" and density.batch_size == density.music_batch_size == 16
        assert density.learning_rate == density.music_learning_rate == 1e-4
        assert not (density.skips or density.velocities or density.unit_variance)
        assert not (density.augmented or density.synchronise) and density.music_target == "clip"
    # Recorded feet, and what was scaled, are on record.
    assert repertoire.provenance["feet_locked"] is False
    assert repertoire.provenance["method"] == f"published: {published.scaling('tiny')}"
    assert "10 epochs of 10,000" in published.scaling("tiny")
    assert repertoire.provenance["style_changes"]["epochs"] == 2


def test_clips_carry_the_density_of_the_network(built):
    repertoire, _ = built
    assert repertoire.density == "learned"
    net = repertoire.net("motion_density")
    estimator = MotionDensity.from_arrays(net.weights, net.config)
    expected = estimator.take_density(repertoire.body_pos_m(0))
    np.testing.assert_allclose(repertoire.clip_motion.density(np.array([0]))[0], expected[:160], atol=1e-6)
    assert abs(expected.std() - 1.0) > 0.1  # of unit variance it would be ours


def test_a_dance_aligns_the_density_of_each_clip_alone(built, song, monkeypatch):
    repertoire, aligned = built[0], []

    def warp_segments(clip, music_density, beats_s, clip_density, *rest, **options):
        aligned.append(clip_density(np.arange(repertoire.n_clips)))
        return segments.warp_segments(clip, music_density, beats_s, clip_density, *rest, **options)

    monkeypatch.setattr(engine, "warp_segments", warp_segments)
    cg.dance(song, repertoire, duration_s=4, config=published.published_dance())
    net = repertoire.net("motion_density")
    estimator = MotionDensity.from_arrays(net.weights, net.config)
    for clip in (0, repertoire.n_clips - 1):
        take, first = repertoire.clip_take[clip], repertoire.clip_start_frame[clip]
        body_m = repertoire.body_pos_m(take)[first : first + 160]
        np.testing.assert_allclose(aligned[0][clip], estimator.clip_densities(body_m[None])[0], atol=1e-5)
    stored = repertoire.clip_motion.density(np.arange(repertoire.n_clips))
    assert np.abs(aligned[0] - stored).max() > 1e-3


def test_a_dance_plays_the_raw_path_on_seconds(made):
    plan = made.plan
    for second in plan.seconds:
        steps = np.diff(second.source_times_s) * 20.0
        assert np.abs(steps[:, None] - [0.5, 1.0, 2.0]).min(axis=1).max() < 1e-3
        assert second.start_s == second.second
        assert second.transition_s == 0.25
    played = {round(float(s), 1) for p in plan.seconds for s in np.diff(p.source_times_s) * 20}
    assert played >= {0.5, 2.0}  # a staircase: smoothed, it would have no steps
    assert (plan.planner, plan.blending) == ("greedy", "linear")
    assert {name: w for name, w in plan.weights.items() if w} == {
        "genre": 1.0, "completeness": 1.0, "transition": pytest.approx(np.sqrt(21)),
    }  # fmt: skip


def test_a_dance_is_rendered_without_locked_feet_held_ends_or_steering(made, built):
    plan = made.plan
    assert (plan.opening_s, plan.closing_s) == (0.0, None)
    assert not plan.lock_feet and plan.stage == "free"
    joined, _ = assemble(
        plan_runs(plan), take_motions(built[0]), fps=60.0, duration_s=plan.duration_s, blending="linear",
        stage="free", to_front=False,
    )  # fmt: skip
    np.testing.assert_array_equal(made.motion.local_quat, joined.local_quat)
    np.testing.assert_array_equal(made.motion.root_pos_m, joined.root_pos_m)
    again = cg.render(cg.Plan.from_json(plan.to_json()), built[0])
    np.testing.assert_array_equal(again.local_quat, made.motion.local_quat)


@pytest.fixture(scope="module")
def learned_contents():
    """A repertoire said to carry learned densities, with and without counts."""
    takes = synthetic_takes()
    return [replace(synthetic_contents(of), density="learned") for of in (takes, with_counts(takes))]


def test_counts_of_takes_are_ignored(learned_contents, song, tmp_path, monkeypatch):
    from choreograph.choreography import song_analysis

    def wanted(repertoire, mel, beats_s, n_seconds):
        return np.tile(motion_density(80, np.arange(0.25, 4.0, 0.5)), (n_seconds, 1))

    monkeypatch.setattr(song_analysis, "_wanted_density", wanted)
    config = published.published_dance(candidates=16, density="learned")  # it has no networks
    danced = []
    for name, contents in zip(("none.h5", "counted.h5"), learned_contents, strict=True):
        write_repertoire(tmp_path / name, contents)
        danced.append(cg.dance(song, Repertoire.open(tmp_path / name), config=config).plan)
    assert [s.source_times_s for s in danced[0].seconds] == [s.source_times_s for s in danced[1].seconds]


def test_a_repertoire_without_learned_densities_is_refused(tmp_path, song):
    analytic = synthetic_repertoire(tmp_path / "a.h5")
    with pytest.raises(RepertoireError, match="expected learned tempo-densities, got analytic") as raised:
        cg.dance(song, analytic, config=published.published_dance())
    assert "--density learned" in str(raised.value) and "\n" not in str(raised.value)
    with pytest.raises(RepertoireError, match="build-db --published"):
        dance_variant(VARIANTS["as-published"], cg.load_song(song), analytic)


def test_variants_as_published_dance_with_their_repertoire(built, song):
    plans = [
        dance_variant(variant, cg.load_song(song), built[0]).plan for variant in variants_named(["published"])
    ]
    assert [plan.planner for plan in plans] == ["greedy", "motion-graph", "greedy"]
    assert not any(plan.lock_feet for plan in plans)
    recorded = np.diff([s.source_times_s for s in plans[2].seconds], axis=1) * 20.0
    np.testing.assert_allclose(recorded, 1.0, atol=1e-3)


@pytest.fixture(scope="module")
def rolling_by_genre(takes, tmp_path_factory):
    """A repertoire by `build-db --published --rollout` of two genres, whose networks have hardly learned."""
    rows = ["name,genre", "slow,folk", "even,folk", "quick,salsa"]
    (takes / "manifest.csv").write_text("\n".join(rows) + "\n")
    options = published.published_build("tiny")
    for changes in ("style_changes", "density_changes"):
        options[changes] = options[changes] | {"epochs": 1}
    options["rollout_changes"] = options["rollout_changes"] | {"steps": 2, "batch_size": 2}
    made = cg.build([takes], tmp_path_factory.mktemp("rolling") / "p.h5", rollout=True, **options)
    (takes / "manifest.csv").unlink()
    return made.repertoire


def test_each_genre_has_a_rollout_network_of_equation_10(rolling_by_genre):
    assert rolling_by_genre.rollout_genres == ("folk", "salsa")
    assert rolling_by_genre.net_names[-2:] == ("rollout_0", "rollout_1")
    config = rolling_by_genre.rollout_net("salsa").config
    assert (config.genre, config.loss, config.perceptual_weight) == ("salsa", "paper", 0.5)
    assert (config.frames, config.learning_rate, config.schedule) == (100, 1e-4, "constant")
    assert not (config.phase or config.count_phase or config.condition_width or config.standardised)
    with pytest.raises(RepertoireError, match="expected a genre among folk, salsa"):
        rolling_by_genre.rollout_net("tango")


@pytest.mark.parametrize("engine", ["rollout", "mixer"])
def test_the_other_engines_draw_motifs_by_equation_5(rolling_by_genre, song, engine):
    config = published.published_dance(engine)
    dance = cg.dance(song, rolling_by_genre, genre="folk", duration_s=6, config=config)
    assert dance.plan.engine == engine and np.isfinite(dance.motion.local_quat).all()
    motifs = [word.motif for word in dance.plan.words]
    v = rolling_by_genre.vocabulary
    row = v.genre_index("folk")
    assert motifs == by_equation_5(len(motifs), v.signatures[row], v.transitions[row])
    again = cg.dance(song, rolling_by_genre, genre="salsa", duration_s=6, config=config)
    assert not np.array_equal(dance.motion.local_quat, again.motion.local_quat)


def by_equation_5(n_words, signature, transitions):
    """Motifs drawn by equation 5 as printed, and the first by the signature."""
    rng, danced, motifs = np.random.default_rng(0), np.zeros(len(signature)), []
    for _ in range(n_words):
        follows = transitions[motifs[-1]] if motifs else signature
        probability = np.abs(danced / max(danced.sum(), 1) - signature) * follows
        if not probability.any():  # nothing is lacking of what may follow
            probability = follows
        motifs.append(int(rng.choice(len(signature), p=probability / probability.sum())))
        danced[motifs[-1]] += 1
    return motifs


def test_equation_5_has_no_positions_in_the_bar():
    """Counted takes: words may begin on any count, as in the paper."""
    starter = cg.starter_repertoire()
    config = published.published_dance("mixer")
    dance = cg.dance(cg.example_songs()["house"], starter, genre="salsa", duration_s=8, config=config)
    motifs = [word.motif for word in dance.plan.words]
    row = starter.vocabulary.genre_index("salsa")
    of_genre = starter.vocabulary.signatures[row], starter.vocabulary.transitions[row]
    assert motifs == by_equation_5(len(motifs), *of_genre)


@pytest.mark.parametrize("engine", ["rollout", "mixer"])
def test_their_dances_have_neither_held_ends_nor_dynamics(rolling_by_genre, song, engine):
    plan = cg.dance(
        song, rolling_by_genre, genre="folk", duration_s=6, config=published.published_dance(engine)
    ).plan
    assert (plan.opening_s, plan.closing_s, plan.amplitudes, plan.stops_s) == (0.0, None, (), ())


def test_the_mixer_takes_the_word_whose_first_poses_are_nearest(rolling_by_genre, song):
    config = published.published_dance("mixer")
    plan = cg.dance(song, rolling_by_genre, genre="folk", duration_s=8, config=config).plan
    assert (plan.planner, plan.blending, plan.front) == ("greedy", "linear", "free")
    assert not plan.lock_feet and plan.stage == "free"
    v, names = rolling_by_genre.vocabulary, [take.name for take in rolling_by_genre.takes]
    start_of = {
        (names[t], round(float(s), 6)): w
        for w, (t, s) in enumerate(zip(v.word_take, v.word_start_s, strict=True))
    }
    folk = [index for index, take in enumerate(rolling_by_genre.takes) if take.credits.genre == "folk"]
    chosen = 0
    inner = plan.words[1:-1]  # the first and the last are extended to the ends of the song
    for before, after in pairwise(inner):
        previous = start_of[before.take, before.source_start_s]
        words = np.flatnonzero((v.word_motif == after.motif) & np.isin(v.word_take, folk))
        last = border_poses_m(rolling_by_genre, previous, before.end_s - before.start_s, [-2, -1, 0])
        distances = [
            np.linalg.norm(
                border_poses_m(rolling_by_genre, word, after.end_s - after.start_s, [0, 1, 2]) - last
            )
            for word in words
        ]
        nearest = words[int(np.argmin(distances))]
        assert start_of[after.take, after.source_start_s] == nearest
        chosen += len(words) > 1
    assert chosen > 0


def border_poses_m(repertoire, word, length_s, frames):
    """Three poses of a word at frames from its start, or from its end if they are negative, from the root."""
    v = repertoire.vocabulary
    start_s, end_s = float(v.word_start_s[word]), float(v.word_end_s[word])
    border_s = end_s if frames[0] < 0 else start_s
    times_s = border_s + (end_s - start_s) / length_s * np.array(frames) / 20.0
    take_m = repertoire.body_pos_m(int(v.word_take[word]))
    return clips_to_root_frame(poses_at(take_m, 20, times_s)[None])[0]


def test_networks_as_published_are_trained_again_without_one_of_their_losses(
    rolling_by_genre, takes, tmp_path
):
    """The ablations of Table 1 are trained on the takes of a repertoire, a network for each genre."""
    recorded = {take.name: take for take in import_takes(takes)}
    names = ["published", "published-no-perceptual-loss"]
    changes = {"steps": 1, "batch_size": 2, "width": 16}
    train(recorded, rolling_by_genre, tmp_path, names, changes=changes)
    nets = ablated_nets(tmp_path)
    assert {name: sorted(of_genres) for name, of_genres in nets.items()} == {
        name: ["folk", "salsa"] for name in names
    }
    config = nets["published-no-perceptual-loss"]["salsa"].config
    assert (config.genre, config.loss, config.perceptual_weight, config.width) == ("salsa", "paper", 0.0, 16)


def test_a_signature_without_a_genre_has_no_network(rolling_by_genre, song):
    signature = rolling_by_genre.vocabulary.signatures[0]
    with pytest.raises(ParameterError, match="expected a genre among folk, salsa beside the signature"):
        cg.dance(
            song, rolling_by_genre, signature=signature, duration_s=6,
            config=published.published_dance("rollout"),
        )  # fmt: skip


def test_every_setting_is_a_setting_and_every_cost_has_a_weight():
    assert set(published.WEIGHTS) == set(DEFAULT_WEIGHTS)
    assert published.published_dance(seed=3).seed == 3
    with pytest.raises(ParameterError, match="preset"):
        published.published_build("huge")
    assert published.scaling("paper") == "at full size"
    assert published.published_build("paper")["style_changes"]["epochs"] == 10_000


def _with_tuples(config):
    return {key: tuple(v) if isinstance(v, list) else v for key, v in config.items()}
