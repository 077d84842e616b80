"""From a song to a dance, on synthetic takes: lengths, bytes, custom costs, unusual songs, edited plans."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import get_args

import jsonschema
import numpy as np
import pytest
import soundfile
from synthetic_repertoire import synthetic_repertoire, synthetic_takes, write_clicks

import choreograph as cg
from choreograph.choreography.graph.costs import DEFAULT_WEIGHTS
from choreograph.core.errors import ChoreographError, NoPathError, ParameterError, RepertoireError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.beat import f_score
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.settings import Blending


def takes_of(dance) -> set[str]:
    return {second.take for second in dance.plan.seconds}


class OnlyTake(cg.Cost):
    """Forbids every take but one."""

    def __init__(self, take: str) -> None:
        self.take = take

    def node(self, layer, song_features):
        return np.where(layer.take_names == self.take, 0.0, np.inf)


class Prefers(cg.Cost):
    """1 for every node of another take."""

    def __init__(self, take: str) -> None:
        self.take = take

    def node(self, layer, song_features):
        return (layer.take_names != self.take).astype(float)


def test_a_dance_lasts_as_long_as_its_song(made):
    assert abs(made.motion.duration_s - 12.4) <= 1 / 60
    assert len(made.plan.seconds) == 13
    assert made.motion.fps == 60


@pytest.mark.parametrize("fps", [25, 29.97, 120.0])
@pytest.mark.parametrize("blending", get_args(Blending))
def test_any_frame_rate(repertoire, song, fps, blending):
    config = cg.DanceConfig(fps=fps, blending=blending, candidates=8, planner="greedy")
    made = cg.dance(song, repertoire, config=config)
    assert abs(made.motion.duration_s - 12.4) <= 1 / fps


def test_the_same_seed_gives_the_same_bytes(made, repertoire, song, tmp_path):
    again = cg.dance(song, cg.Repertoire.open(repertoire.path))
    for suffix in (".json", ".bvh", ".npz"):
        files = []
        for index, dance in enumerate((made, again)):
            path = tmp_path / f"{index}{suffix}"
            dance.save(path)
            files.append(path.read_bytes())
        assert files[0] == files[1], suffix


@pytest.mark.slow
def test_each_kernel_of_a_dance_is_compiled_once_for_the_signature_that_is_compiled_ahead():
    """In a new process, since other tests call kernels with other types."""
    code = (
        "import choreograph as cg\n"
        "from choreograph.core import kernel_cache\n"
        "from numba.core.sigutils import normalize_signature\n"
        "cg.dance(cg.example_songs()['house'], duration_s=8, cache=False)\n"
        "for kernel, ahead in kernel_cache._ahead.items():\n"
        "    assert kernel.signatures == [normalize_signature(ahead)[0]], kernel\n"
        "    assert kernel.nopython_signatures[0].return_type == normalize_signature(ahead)[1], kernel\n"
        "print(len(kernel_cache._ahead))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= 9


def test_steps_fall_on_the_clicks(made):
    beats = motion_beat_times_s(body_pos_m(made.motion), made.motion.fps)
    clicks = np.arange(0, 12.4, 0.5)
    assert f_score(beats, clicks) > 0.7


def test_every_second_has_credits(made, repertoire):
    not_in_every_dance = {"stage", "form", "signature", "motif_transition"}
    takes = {take.name: take for take in repertoire.takes}
    for second in made.plan.seconds:
        assert second.credits == takes[second.take].credits
        assert second.credits.licence == "CC0"
        assert repertoire.takes[repertoire.clip_take[second.clip]].name == second.take
        assert second.clip_start_s <= second.source_times_s[0] < second.source_times_s[-1]
        assert second.source_times_s[-1] <= second.clip_start_s + 8
        assert set(second.costs) == set(DEFAULT_WEIGHTS) - not_in_every_dance
    schema = Path(__file__).resolve().parents[2] / "data_schema" / "plan.schema.json"
    jsonschema.validate(json.loads(made.plan.to_json()), json.loads(schema.read_text(encoding="utf-8")))


def test_a_forbidden_take_is_not_danced_and_a_preferred_one_is(repertoire, song):
    for take in ("take0", "take2"):
        assert takes_of(cg.dance(song, repertoire, costs=[OnlyTake(take)])) == {take}
    made = cg.dance(song, repertoire, costs=[Prefers("take1")], weights={"prefers": 100.0})
    assert takes_of(made) == {"take1"}
    assert made.plan.weights["prefers"] == 100.0
    assert all(second.costs["prefers"] == 0 for second in made.plan.seconds)


def test_a_cost_that_forbids_everything_is_reported(repertoire, song):
    with pytest.raises(NoPathError, match="second 0"):
        cg.dance(song, repertoire, costs=[OnlyTake("nobody's")])


def test_weights_and_costs_that_do_not_exist_or_collide(repertoire, song):
    with pytest.raises(ParameterError, match="'stile'"):
        cg.dance(song, repertoire, weights={"stile": 1.0})

    class Genre(cg.Cost):
        pass

    with pytest.raises(ParameterError, match="two share one among"):
        cg.dance(song, repertoire, costs=[Genre()])


def test_the_exact_path_never_costs_more_than_the_greedy_one(made, repertoire, song):
    greedy = cg.dance(song, repertoire, config=cg.DanceConfig(planner="greedy"))
    assert made.plan.total_cost <= greedy.plan.total_cost + 1e-4
    paid = [sum(second.costs.values()) for second in greedy.plan.seconds]
    assert greedy.plan.total_cost == pytest.approx(sum(paid))


def test_the_motion_graph_dances_first_seconds_of_segments(repertoire, song):
    made = cg.dance(song, repertoire, config=cg.DanceConfig(planner="motion-graph"))
    assert {second.offset for second in made.plan.seconds} == {0}
    assert abs(made.motion.duration_s - 12.4) <= 1 / 60


@pytest.mark.parametrize("duration_s", [0.02, 1.0, 2.5, 4.0, 5.01])
def test_short_songs(repertoire, tmp_path, duration_s):
    made = cg.dance(write_clicks(tmp_path / "short.wav", duration_s=duration_s), repertoire)
    assert abs(made.motion.duration_s - duration_s) <= 1 / 60
    if duration_s < 4:
        assert any("less than the 4 s" in note for note in made.notes)


def test_a_silent_song_is_danced_and_noted(repertoire, tmp_path):
    soundfile.write(tmp_path / "silent.wav", np.zeros(6 * SAMPLE_RATE_HZ), SAMPLE_RATE_HZ)
    made = cg.dance(tmp_path / "silent.wav", repertoire)
    assert abs(made.motion.duration_s - 6) <= 1 / 60
    assert any("silent" in note for note in made.notes)
    assert all("\n" not in note for note in made.notes)


def test_a_part_of_a_song(repertoire, song):
    made = cg.dance(song, repertoire, start_s=3.0, duration_s=5.5)
    assert abs(made.motion.duration_s - 5.5) <= 1 / 60
    assert made.plan.start_s == 3.0


@pytest.mark.parametrize("loaded_from_s", [0.0, 1.0])
def test_a_part_of_a_loaded_song_is_that_of_its_file(repertoire, song, loaded_from_s):
    loaded = cg.load_song(song, start_s=loaded_from_s)
    wanted = cg.load_song(song, start_s=3.0, duration_s=5.5)
    given = {"start_s": 3.0 - loaded_from_s, "duration_s": 5.5}
    made = [
        cg.dance(loaded, repertoire, candidates=4, **given),
        *cg.vary(loaded, repertoire, 1, candidates=4, **given),
    ]
    for one in made:
        assert one.plan.start_s == 3.0
        assert one.plan.duration_s == pytest.approx(5.5, abs=1e-4)
        assert one.plan == cg.dance(wanted, repertoire, candidates=4).plan
    with pytest.raises(ParameterError, match="the song ends before"):
        cg.dance(loaded, repertoire, start_s=20.0)


def test_a_song_shorter_than_asked_for_is_said(repertoire, song):
    for given in (song, cg.load_song(song)):
        made = cg.dance(given, repertoire, candidates=4, start_s=4.0, duration_s=60.0)
        assert [note for note in made.notes if "60 s were requested, the song ends after 8.40 s" in note]


def test_fewer_clips_than_candidates_and_one_genre_only(tmp_path, song):
    few = synthetic_repertoire(
        tmp_path / "few.h5", synthetic_takes(periods_s=[0.5], duration_s=8.5, genres=["a"])
    )
    assert few.n_clips == 1
    made = cg.dance(song, few)
    assert takes_of(made) == {"take0"}
    assert any("1 clip, fewer than 512" in note for note in made.notes)
    assert abs(made.motion.duration_s - 12.4) <= 1 / 60


def test_a_repertoire_without_any_clip(tmp_path, song):
    short = synthetic_repertoire(tmp_path / "short.h5", synthetic_takes(periods_s=[0.5], duration_s=5.0))
    with pytest.raises(RepertoireError, match="no clip"):
        cg.dance(song, short)


def test_an_untouched_plan_renders_the_same_dance(made, repertoire):
    plan = cg.Plan.from_json(made.plan.to_json())
    again = cg.render(plan, repertoire)
    assert np.array_equal(again.root_pos_m, made.motion.root_pos_m)
    assert np.array_equal(again.local_quat, made.motion.local_quat)


def test_an_edited_plan_is_rendered_as_edited(made, repertoire):
    seconds = list(made.plan.seconds)
    other = "take2" if seconds[5].take != "take2" else "take1"
    times = tuple(4.0 + 0.05 * i for i in range(21))
    seconds[5] = replace(seconds[5], take=other, source_times_s=times, start_s=5.0)
    seconds[6] = replace(seconds[6], start_s=6.0)
    edited = cg.render(replace(made.plan, seconds=tuple(seconds)), repertoire)
    assert edited.n_frames == made.motion.n_frames
    assert np.isfinite(edited.root_pos_m).all()
    # What the transitions cannot reach is untouched (except by foot locking), the edited second is not.
    arms = slice(made.motion.skeleton.index("neck"), None)
    assert np.allclose(edited.local_quat[:200, arms], made.motion.local_quat[:200, arms], atol=1e-3)
    assert not np.allclose(edited.local_quat[320:340, arms], made.motion.local_quat[320:340, arms], atol=1e-2)
    # Inside the edited second, past its transitions, the body moves as the take does there.
    source, first_s = repertoire.motion(repertoire.take_index(other), 4.4, 4.6)
    at = (np.array([4.5]) - first_s) * source.fps
    assert np.allclose(source.sampled(at).local_quat[0, arms], edited.local_quat[330, arms], atol=1e-3)


@pytest.mark.parametrize(
    "change",
    [
        {"take": "nobody's"},
        {"source_times_s": tuple(29.5 + 0.05 * i for i in range(21))},
        {"source_times_s": tuple(-1.2 + 0.05 * i for i in range(21))},
    ],
)
def test_a_plan_of_missing_takes_or_times(made, repertoire, change):
    seconds = (*made.plan.seconds[:3], replace(made.plan.seconds[3], **change), *made.plan.seconds[4:])
    with pytest.raises(ChoreographError) as raised:
        cg.render(replace(made.plan, seconds=seconds), repertoire)
    assert "\n" not in str(raised.value)


def test_outputs_are_whole_or_absent(made, tmp_path):
    with pytest.raises(ParameterError):
        made.save(tmp_path / "missing" / "out.bvh")
    with pytest.raises(ParameterError):
        made.save(tmp_path / "out.xyz")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("settings", "dancing"),
    [
        ({}, ["warping", "planning", "timing transitions", "rendering"]),
        ({"planner": "motion-graph"}, ["warping", "planning", "timing transitions", "rendering"]),
        ({"engine": "mixer"}, ["rendering"]),
    ],
)
def test_progress_goes_forward_to_the_end_of_every_stage_in_order(
    settings, dancing, song, tmp_path, monkeypatch
):
    monkeypatch.setenv("CHOREOGRAPH_CACHE", str(tmp_path))  # without a kept analysis of the song
    repertoire = synthetic_repertoire(tmp_path / "motifs.h5", vocabulary=True)
    seen: dict[str, list[tuple[int, int]]] = {}
    order = []

    def report(stage, done, total):
        seen.setdefault(stage, []).append((done, total))
        order.append(stage)

    cg.dance(song, repertoire, report=report, **settings).save(tmp_path / "a.html", report=report)
    stages = ["analysing the song", *dancing, "writing the page"]
    assert [stage for stage, before in zip(order, ["", *order], strict=False) if stage != before] == stages
    for reports in seen.values():
        known = [(done, total) for done, total in reports if total]  # 0: not known yet
        assert len({total for _, total in known}) == 1
        assert [done for done, _ in known] == sorted(done for done, _ in known)
        assert known[-1][0] == known[-1][1]
        assert len(known) > 2


def test_poses_of_the_last_frame_of_a_take_are_its_own(repertoire):
    # The clip that ends with its take: asking for its very end must not read the next take.
    last = int(np.flatnonzero(repertoire.clip_take == 0)[-1])
    pose, velocity = repertoire.clip_motion.poses_m(np.array([last]), np.array([159.0]))
    assert np.isfinite(pose).all()
    assert np.abs(velocity).max() < 3.0


def test_without_warping_takes_are_danced_as_recorded(repertoire, song):
    made = cg.dance(song, repertoire, config=cg.DanceConfig(warping="none", transitions="seconds"))
    for second in made.plan.seconds:
        assert np.diff(second.source_times_s) == pytest.approx(0.05, abs=1e-4)
        assert second.source_times_s[0] == pytest.approx(second.clip_start_s + 2.0 + second.offset, abs=1e-4)


def test_without_selection_any_clip_is_a_candidate(repertoire, song):
    def takes(**settings):
        made = cg.dance(song, repertoire, config=cg.DanceConfig(candidates=3, **settings))
        return [(second.take, second.clip) for second in made.plan.seconds]

    drawn = takes(selection="random", seed=1)
    assert drawn == takes(selection="random", seed=1) != takes(selection="random", seed=2)
    assert drawn != takes(selection="style", seed=1)


@pytest.mark.parametrize(
    "settings", [{}, {"engine": "mixer", "phrase_counts": 1, "seed": 4}, {"engine": "rollout"}], ids=str
)
def test_a_long_song_in_blocks_and_files_has_the_dance_of_a_short_one(settings, monkeypatch):
    arguments = {"duration_s": 9.3, "cache": False, **settings}
    whole = cg.dance(cg.example_songs()["cha-cha"], **arguments)
    for name, limit in (
        ("core.long_songs.LONG_S", 1.0),
        ("choreography.enforcement.WORDS_AT_ONCE", 128), ("choreography.rollout.engine.WORDS_AT_ONCE", 128),
    ):  # fmt: skip
        monkeypatch.setattr(f"choreograph.{name}", limit)
    found = cg.dance(cg.example_songs()["cha-cha"], **arguments)
    assert found.plan.to_json() == whole.plan.to_json() and found.notes == whole.notes
    assert np.array_equal(found.motion.local_quat, whole.motion.local_quat)
    assert np.array_equal(found.motion.root_pos_m, whole.motion.root_pos_m)
