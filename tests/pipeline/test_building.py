"""Building a repertoire with its networks, from real takes: resumed, taken over, danced with."""

import numpy as np
import pytest

import choreograph as cg
from choreograph.errors import ParameterError
from choreograph.pipeline import BuildOptions, build_repertoire

TAKES = ("DANCE_C_8", "DANCE_R_2", "DANCE_W_11")


@pytest.fixture(scope="module")
def takes(shared_data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("takes")
    for name in TAKES:
        (folder / name).symlink_to(shared_data / "dance-with-melody" / name)
    return folder


@pytest.mark.slow
def test_build_resume_take_over_and_dance(takes, tmp_path):
    progress = []
    built, _ = build_repertoire(
        [takes], tmp_path / "a.h5", BuildOptions(preset="tiny"), training_report=progress.append
    )
    assert set(built.net_names) == {"style", "motion_density", "music_density"}
    assert {take.credits.genre for take in built.takes} == {"cha-cha", "rumba", "waltz"}
    assert np.isfinite(built.clip_style).all()
    assert built.clip_style.std(axis=0).max() > 0.01  # a collapsed embedding would be constant
    assert {state.name for state in progress} == set(built.net_names)

    # Everything is trained: resuming only writes the file again, to the same bytes.
    first = built.path.read_bytes()
    again, _ = build_repertoire([takes], tmp_path / "a.h5", BuildOptions(preset="tiny", resume=True))
    assert again.path.read_bytes() == first

    one, notes = build_repertoire(
        [takes], tmp_path / "b.h5", BuildOptions(preset="tiny", init_from=built.path, leave_out=TAKES[1:])
    )
    assert any("taken over" in note for note in notes)
    assert [take.name for take in one.takes] == [TAKES[0]]

    kept, _ = build_repertoire(
        [takes], tmp_path / "c.h5", BuildOptions(init_from=built.path, keep_networks=True, packed=True)
    )
    assert kept.provenance["trained_on"] == built.provenance["trained_on"]
    assert not (tmp_path / "c.h5.build").exists()
    assert kept.path.stat().st_size < 0.5 * built.path.stat().st_size
    np.testing.assert_allclose(kept.clip_style, built.clip_style, atol=1e-5)

    made = cg.dance(takes / "DANCE_W_11" / "audio.mp3", built, duration_s=12.0)
    assert abs(made.motion.n_frames - 12.0 * 60) <= 1


def test_two_takes_of_one_name_are_refused(takes, tmp_path):
    with pytest.raises(ParameterError, match="two takes are called"):
        build_repertoire([takes / TAKES[0], takes / TAKES[0]], tmp_path / "x.h5")
    assert not (tmp_path / "x.h5").exists()


def test_networks_to_keep_must_be_given(takes, tmp_path):
    with pytest.raises(ParameterError, match="init-from"):
        build_repertoire([takes], tmp_path / "x.h5", BuildOptions(keep_networks=True))
