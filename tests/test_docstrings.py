"""Docstrings of the public API: every name has an example that runs, every public method has a docstring."""

from __future__ import annotations

import doctest
import importlib
import inspect
import re

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import choreograph as cg

EXAMPLES = re.compile(r"^Examples\n-{8}\n(.+?)(?=^\S[^\n]*\n-{3,}\n|\Z)", flags=re.S | re.M)
# Names whose docstring has no example yet, by room. They only become fewer: a name with an example must go.
TO_DO_BY_ROOM: dict[str, tuple[str, ...]] = {
    "choreography": (
        "Ban",
        "Cost",
        "Keep",
        "Layer",
        "MotifPin",
        "TakePin",
    ),
    "motion": (
        "Credits",
        "Motion",
        "Skeleton",
        "Take",
    ),
    "pipeline": (
        "Dance",
        "RolloutFrame",
        "RolloutStream",
        "motifs_of",
        "signature_of",
    ),
    "plan": ("Plan",),
    "music": (
        "Song",
        "SongFeatures",
        "load_song",
    ),
    "choreograph": ("__version__",),
    "evaluation": (
        "evaluate",
        "metrics",
    ),
    "render": ("render",),
    "metrics.beat": (
        "metrics.beat.aligned_share",
        "metrics.beat.alignment_score",
        "metrics.beat.beat_ratio",
        "metrics.beat.chance_f_score",
        "metrics.beat.chance_level",
        "metrics.beat.evaluate",
        "metrics.beat.evaluate_chance",
        "metrics.beat.evaluate_published",
        "metrics.beat.f_score",
        "metrics.beat.published_motion_beats_s",
        "metrics.beat.squared_distance",
        "metrics.beat.validate",
    ),
    "metrics.contact_scores": (
        "metrics.contact_scores.evaluate",
        "metrics.contact_scores.foot_skating_ratio",
        "metrics.contact_scores.pfc",
        "metrics.contact_scores.validate",
    ),
    "metrics.count_phase": (
        "metrics.count_phase.evaluate",
        "metrics.count_phase.phase_distance",
        "metrics.count_phase.phase_histogram",
        "metrics.count_phase.phases",
        "metrics.count_phase.validate",
    ),
    "metrics.counts": (
        "metrics.counts.beat_positions",
        "metrics.counts.count_drift",
        "metrics.counts.count_error_beats",
        "metrics.counts.count_error_s",
        "metrics.counts.counts_per_beat",
        "metrics.counts.counts_within",
        "metrics.counts.downbeat_nearest",
        "metrics.counts.downbeat_share",
        "metrics.counts.evaluate",
        "metrics.counts.evaluate_chance",
        "metrics.counts.signed_errors_beats",
        "metrics.counts.uniform_chance",
        "metrics.counts.validate",
    ),
    "metrics.endings": (
        "metrics.endings.closing_speed_m_s",
        "metrics.endings.evaluate",
        "metrics.endings.held_from_s",
        "metrics.endings.hold_delay_s",
        "metrics.endings.opening_speed_m_s",
        "metrics.endings.validate",
    ),
    "metrics.energy_response": (
        "metrics.energy_response.evaluate",
        "metrics.energy_response.evaluate_chance",
        "metrics.energy_response.motion_size",
        "metrics.energy_response.pooled_response",
        "metrics.energy_response.response",
        "metrics.energy_response.section_loudness_db",
        "metrics.energy_response.section_means",
        "metrics.energy_response.soft_to_loud",
        "metrics.energy_response.turned_round",
        "metrics.energy_response.validate",
    ),
    "metrics.fid": (
        "metrics.fid.canonical_pos_m",
        "metrics.fid.diversity",
        "metrics.fid.evaluate",
        "metrics.fid.features_of",
        "metrics.fid.fid",
        "metrics.fid.geometric",
        "metrics.fid.kinetic",
        "metrics.fid.validate",
    ),
    "metrics.frechet": (
        "metrics.frechet.evaluate",
        "metrics.frechet.fit_gaussian",
        "metrics.frechet.fmd",
        "metrics.frechet.fpd",
        "metrics.frechet.frechet_distance",
        "metrics.frechet.gaussians",
        "metrics.frechet.movements_of",
        "metrics.frechet.poses_rad",
        "metrics.frechet.validate",
    ),
    "metrics.labels": (
        "metrics.labels.chance_distances",
        "metrics.labels.dance_values",
        "metrics.labels.evaluate",
        "metrics.labels.fit_scale",
        "metrics.labels.label_distances",
        "metrics.labels.music_values",
        "metrics.labels.validate",
        "metrics.labels.window_starts_s",
    ),
    "metrics.motion_beat_detectors": (
        "metrics.motion_beat_detectors.aist_beats_s",
        "metrics.motion_beat_detectors.beats_by_detector",
        "metrics.motion_beat_detectors.evaluate",
        "metrics.motion_beat_detectors.evaluate_chance",
        "metrics.motion_beat_detectors.f_score_mean_of_detectors",
        "metrics.motion_beat_detectors.gaussian_beats_s",
        "metrics.motion_beat_detectors.our_beats_s",
        "metrics.motion_beat_detectors.savitzky_golay_beats_s",
        "metrics.motion_beat_detectors.scores_of",
        "metrics.motion_beat_detectors.validate",
    ),
    "metrics.physical": (
        "metrics.physical.evaluate",
        "metrics.physical.floating_share",
        "metrics.physical.floor_penetration_cm",
        "metrics.physical.foot_slide_cm_s",
        "metrics.physical.jerk_ratio_at",
        "metrics.physical.joint_jerk_m_s3",
        "metrics.physical.joint_speed_m_s",
        "metrics.physical.jump_times_s",
        "metrics.physical.jumps_per_minute",
        "metrics.physical.limb_length_spread_mm",
        "metrics.physical.speed_ratio_at",
        "metrics.physical.validate",
    ),
    "metrics.references": (
        "metrics.references.halves",
        "metrics.references.shuffled_frames",
        "metrics.references.shuffled_joints",
        "metrics.references.still",
    ),
    "metrics.structure": (
        "metrics.structure.distinct_takes_per_minute",
        "metrics.structure.evaluate",
        "metrics.structure.longest_repeat",
        "metrics.structure.longest_repeat_s",
        "metrics.structure.motifs_by_section",
        "metrics.structure.motifs_in_step",
        "metrics.structure.section_agreement",
        "metrics.structure.shared_motifs",
        "metrics.structure.signature_distance",
        "metrics.structure.transition_bits",
        "metrics.structure.transition_chance_bits",
        "metrics.structure.validate",
    ),
    "metrics.transitions": (
        "metrics.transitions.at_bar_borders",
        "metrics.transitions.at_borders",
        "metrics.transitions.at_figure_borders",
        "metrics.transitions.evaluate",
        "metrics.transitions.mean_gap_s",
        "metrics.transitions.on_counts",
        "metrics.transitions.transitions_per_minute",
        "metrics.transitions.uniform_chance",
        "metrics.transitions.validate",
    ),
}
TO_DO = {name for names in TO_DO_BY_ROOM.values() for name in names}


def functions_of_metrics() -> dict[str, object]:
    """Each public function of each module of `cg.metrics` by its name, `metrics.MODULE.FUNCTION`."""
    found: dict[str, object] = {}
    for name in cg.metrics.__all__:
        module = getattr(cg.metrics, name)
        for function, value in vars(module).items():
            if inspect.isfunction(value) and value.__module__ == module.__name__ and function[0] != "_":
                found[f"metrics.{name}.{function}"] = value
    return found


# A text has no docstring of its own: the package's stands for `__version__`.
PUBLIC = {name: getattr(cg, name) for name in cg.__all__} | {"__version__": cg} | functions_of_metrics()
CLASSES = {name: value for name, value in PUBLIC.items() if inspect.isclass(value)}


def examples(value: object) -> str | None:
    """The text of the section `Examples` of a docstring, where there is one."""
    found = EXAMPLES.search(inspect.cleandoc(value.__doc__ or ""))
    return found and found[1]


@pytest.mark.parametrize("name", PUBLIC)
def test_the_example_of_a_public_name_runs(name, tmp_path, monkeypatch):
    value = PUBLIC[name]
    # A dataclass without a docstring is given its signature as one.
    assert (value.__doc__ or "").strip() and not value.__doc__.startswith(f"{name}("), (
        f"{name} has no docstring"
    )
    text = examples(value)
    if name in TO_DO:
        assert text is None, f"{name} has an example now: take it out of TO_DO"
        pytest.skip("no example yet")
    assert text is not None, f"expected a section Examples in the docstring of {name}"

    home = value if inspect.ismodule(value) else importlib.import_module(value.__module__)
    test = doctest.DocTestParser().get_doctest(text, {"cg": cg, "np": np}, name, home.__file__, 0)
    assert test.examples, f"expected >>> in the section Examples of {name}"
    monkeypatch.chdir(tmp_path)
    report: list[str] = []
    with threadpool_limits(1):
        runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
        runner.run(test, out=report.append)
    assert not report, "".join(report)


def test_names_without_an_example_are_public_names():
    assert set(PUBLIC) >= TO_DO


@pytest.mark.parametrize("name", CLASSES)
def test_every_public_method_has_a_docstring(name):
    kinds = (property, classmethod, staticmethod)
    silent = {
        f"{owner.__name__}.{member}"
        for owner in CLASSES[name].__mro__
        if owner.__module__.startswith("choreograph")
        for member, value in vars(owner).items()
        if not member.startswith("_") and (callable(value) or isinstance(value, kinds))
        if not (value.__doc__ or "").strip()
    }
    assert not silent, f"public methods of {name} without docstring: {silent}"
