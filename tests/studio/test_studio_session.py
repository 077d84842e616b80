"""The studio: changes are local, saved before they are shown, and come back to the same bytes."""

from __future__ import annotations

import numpy as np
import pytest
from faults.injection import small_disk

from choreograph.choreography.edits import Repeat, Swap, Vary, slot_bounds_s
from choreograph.core.errors import ChoreographError, ParameterError, RepertoireError
from choreograph.library.repertoire import starter_repertoire
from choreograph.render.rendering import render
from choreograph.studio.project import ProjectFile
from choreograph.studio.refusals import ConflictError, NotFoundError
from choreograph.studio.steps import StepDances
from choreograph.studio.studio_session import Repertoires, StudioSession

# The studio: changes are local, saved before they are shown, and come back to the same bytes.


def motion_of(studio):
    motion = studio.state.dance.motion
    return np.concatenate([motion.root_pos_m[:, None], motion.local_quat[..., 1:]], axis=1)


def is_same(a, b):
    return a.tobytes() == b.tobytes()


def test_the_first_dance_is_made_and_saved(studio, folder):
    assert studio.project.revision == 1 and studio.file == folder / "clicks.studio.json"
    assert studio.file.exists() and not studio.project.can_undo


def test_an_edit_changes_its_span_and_two_beats_alone(studio):
    before = motion_of(studio)
    studio.edit(1, [Swap(4.0, 6.0)])
    changed = np.flatnonzero((motion_of(studio) != before).any(axis=(1, 2))) / 60
    beat_s = np.median(np.diff(slot_bounds_s(studio.state.dance.plan)))
    assert 4.0 - 2.1 * beat_s <= changed.min() and changed.max() <= 6.0 + 2.1 * beat_s
    [(start_s, end_s)] = studio.state.changed
    assert start_s <= changed.min() + 0.05 and changed.max() - 0.05 <= end_s


def test_a_chain_of_changes_comes_back_from_the_file_and_can_be_undone(studio, open_session, repertoire):
    shown = [motion_of(studio)]
    for one in (Swap(2.0, 4.0), Vary(7.0, 9.0), Repeat(2.0, 4.0, 8.0, mirrored=True)):
        studio.edit(studio.project.revision, [one], seed=1)
        shown.append(motion_of(studio))
    studio.change_settings(studio.project.revision, {"seed": 5})
    shown.append(motion_of(studio))
    studio.edit(studio.project.revision, [Swap(5.0, 6.0)])
    shown.append(motion_of(studio))
    studio.close()
    again = open_session()
    assert is_same(motion_of(again), shown[-1])
    plan = again.state.dance.plan
    assert is_same(render(plan, repertoire).local_quat, again.state.dance.motion.local_quat)
    for expected in shown[-2::-1]:
        again.move(again.project.revision, back=True)
        assert is_same(motion_of(again), expected)
    for expected in shown[1:]:
        again.move(again.project.revision, back=False)
        assert is_same(motion_of(again), expected)


def test_undo_without_motions_in_memory_renders_the_same(studio):
    before = motion_of(studio)
    studio.edit(1, [Swap(2.0, 4.0)])
    after = motion_of(studio)
    studio._dances = StepDances(studio.state.repertoire)
    studio.move(2, back=True)
    assert is_same(motion_of(studio), before)
    studio.move(3, back=False)
    assert is_same(motion_of(studio), after)


def test_locked_parts_are_kept_when_the_dance_is_made_again(studio):
    studio.lock(1, [(2.0, 6.0)])
    before = motion_of(studio)
    studio.change_settings(2, {"seed": 3})
    same = (motion_of(studio) == before).all(axis=(1, 2))
    assert same[121:359].all() and not same[400:].all()
    studio.change_settings(3, {"seed": 4}, keep_locked=False)
    assert not (motion_of(studio) == before)[121:359].all()


def test_a_locked_part_is_not_edited(studio):
    studio.lock(1, [(4.0, 6.0)])
    before = motion_of(studio)
    with pytest.raises(ParameterError, match="locked"):
        studio.edit(2, [Swap(5.0, 8.0)])
    assert is_same(motion_of(studio), before) and studio.project.revision == 2
    studio.edit(2, [Swap(8.0, 10.0)])


def test_a_span_is_made_again_with_a_setting_of_its_own(studio):
    before = motion_of(studio)
    studio.change_settings(1, {"seed": 7}, span=(4.0, 8.0))
    same = (motion_of(studio) == before).all(axis=(1, 2))
    assert same[:239].all() and same[481:].all() and not same.all()
    assert studio.project.settings.seed == 0


def test_an_old_revision_is_refused(studio):
    studio.edit(1, [Swap(4.0, 6.0)])
    for change in (
        lambda: studio.edit(1, [Swap(4.0, 6.0)]), lambda: studio.change_settings(1, {}),
        lambda: studio.lock(1, []),
        lambda: studio.move(1, back=True), lambda: studio.choose(1, "1-0"),
        lambda: studio.alternatives(1, (2, 4), 2),
    ):  # fmt: skip
        with pytest.raises(ConflictError):
            change()
    assert studio.project.revision == 2


def test_what_cannot_be_written_is_not_shown(studio, monkeypatch):
    before, state = studio.file.read_bytes(), studio.state

    def full(file, project):
        raise ChoreographError("cannot write: no space left")

    with monkeypatch.context() as patch:
        patch.setattr(ProjectFile, "write", full)
        for change in (
            lambda: studio.edit(1, [Swap(4.0, 6.0)]),
            lambda: studio.change_settings(1, {"seed": 1}),
        ):
            with pytest.raises(ChoreographError, match="space"):
                change()
            assert studio.state is state and studio.file.read_bytes() == before
    studio.edit(1, [Swap(4.0, 6.0)])
    assert studio.project.revision == 2


def test_alternatives_are_small_differ_and_one_is_chosen(folder):
    """With the built-in takes, since the synthetic ones are too similar."""
    studio = StudioSession(folder, starter_repertoire())
    studio.open(folder / "clicks.wav")
    studio.load(None, None)
    found = studio.alternatives(1, (4.0, 6.0), 3)
    assert 1 <= len(found) <= 3 and [one["cost"] for one in found] == sorted(one["cost"] for one in found)
    assert all(one["facts"]["fps"] == 20 and one["why"] and len(one["motion"]) < 20_000 for one in found)
    before = motion_of(studio)
    studio.choose(1, found[-1]["id"])
    assert not is_same(motion_of(studio), before)
    assert studio.state.dance.plan.edits[-1].words[0].start_s == found[-1]["start_s"]
    with pytest.raises(NotFoundError):
        studio.choose(2, found[0]["id"])
    studio.close()


def test_a_part_of_a_take_is_pinned_from_the_nearest_count(studio, repertoire):
    take = repertoire.takes[0]
    for source_s in (3.0, 6.0):
        studio.pin_part(studio.project.revision, (5.0, 7.0), take.name, source_s)
        words = studio.state.dance.plan.edits[-1].words
        begun = next(word for word in words if word.start_s >= 5.0 - 0.3 and word is not words[0])
        assert {word.take for word in words} == {take.name}
        assert abs(begun.source_start_s - source_s) < 1.0
    with pytest.raises(ChoreographError):
        studio.pin_part(studio.project.revision, (5.0, 7.0), "none", 3.0)


def test_a_ban_stays_when_the_dance_is_made_again(studio):
    take = next(iter(studio.state.dance.plan.takes_s()))
    from choreograph.choreography.constraints import Ban

    studio.edit(1, [Ban(take=take)], bans=[f"take:{take}"])
    studio.change_settings(2, {"seed": 1})
    assert take not in studio.state.dance.plan.takes_s() and studio.project.settings.bans == (f"take:{take}",)


def test_the_mixer_dances_with_weights_of_the_graph(studio):
    studio.change_settings(1, {"weights": {"pace": 2.0}})
    with pytest.raises(ChoreographError):
        studio.change_settings(2, {"weights": {"nothing": 2.0}})
    assert studio.project.revision == 2


def test_versions_are_dances_of_their_own(studio):
    studio.keep_version("A")
    first = motion_of(studio)
    studio.edit(studio.project.revision, [Swap(4.0, 6.0)])
    studio.keep_version("B")
    step, dance = studio.version("A")
    assert step.number == 1 and is_same(dance.motion.local_quat[..., 1:], first[:, 1:])
    assert studio.facts("A")["edits"] == [] and len(studio.facts("B")["edits"]) == 1
    with pytest.raises(NotFoundError):
        studio.version("C")


def test_a_project_of_another_song_is_refused(studio, folder, repertoire):
    studio.close()
    (folder / "other.wav").write_bytes((folder / "clicks.wav").read_bytes())
    other = StudioSession(folder, repertoire)
    with pytest.raises(ChoreographError, match=r"clicks\.wav"):
        other.open(folder / "other.wav", folder / "clicks.studio.json")
    with pytest.raises(ParameterError, match="beside its song"):
        other.open(folder / "other.wav", folder.parent / "x.studio.json")


def test_without_a_song_there_is_no_dance(repertoire, tmp_path):
    studio = StudioSession(tmp_path, repertoire)
    for ask in (studio.current, studio.song, lambda: studio.lock(0, [])):
        with pytest.raises(NotFoundError):
            ask()
    studio.change_settings(0, {"seed": 4})
    assert studio.project.settings.seed == 4


@pytest.mark.slow
def test_a_dance_of_the_network_is_made_edited_undone_and_opened_again(folder):
    """A rollout cannot be rendered from its plan. It is made again with its settings, to the same bytes."""

    def opened():
        studio = StudioSession(folder, starter_repertoire())
        studio.open(folder / "clicks.wav")
        studio.load(None, None)
        return studio

    studio = opened()
    studio.change_settings(1, {"engine": "rollout", "seed": 2})
    generated = motion_of(studio)
    assert studio.state.dance.plan.engine == "rollout" and not studio.state.dance.plan.from_takes
    studio.edit(2, [Swap(4.0, 6.0)])
    edited = motion_of(studio)
    same = (edited == generated).all(axis=(1, 2))
    assert same[: 3 * 60].all() and same[8 * 60 :].all() and not same[5 * 60]
    studio.lock(3, [(8.0, 10.0)])
    with pytest.raises(ParameterError, match="rollout, which generates whole dances"):
        studio.change_settings(4, {"seed": 3})
    with pytest.raises(ParameterError, match="whose takes are not known"):
        studio.edit(4, [Repeat(2.0, 3.0, 5.0)])
    studio.close()
    again = opened()
    assert is_same(motion_of(again), edited)
    again._dances = StepDances(again.state.repertoire)
    again.move(again.project.revision, back=True)
    assert is_same(motion_of(again), generated)
    again.change_settings(
        again.project.revision, {"engine": "graph"}, keep_locked=True
    )  # around what is locked
    kept = (motion_of(again) == generated).all(axis=(1, 2))
    assert kept[8 * 60 + 2 : 10 * 60 - 2].all() and not kept.all()
    facts = again.facts()
    assert facts["engine"] and facts["blocks"]
    again.close()


def fill(path):
    """Write a file until its disk is full."""
    try:
        with open(path, "wb", buffering=0) as file:
            while file.write(bytes(4096)):
                pass
    except OSError:
        return


@pytest.fixture
def disk(tmp_path):
    try:
        with small_disk(tmp_path / "disk", 4 << 20):
            yield tmp_path / "disk"
    except OSError as error:
        pytest.skip(f"no small disk on this machine: {error}")


def test_a_full_disk_loses_no_edit(repertoire, song, disk):
    """An edit that cannot be written is refused in one line, and all before it are in the file."""
    (disk / "clicks.wav").write_bytes(song.read_bytes())
    sessions = [StudioSession(disk, repertoire), StudioSession(disk, repertoire)]
    try:
        studio, again = sessions
        studio.open(disk / "clicks.wav")
        studio.load(None, None)
        studio.edit(1, [Swap(2.0, 4.0)])
        saved, shown, before = studio.file.read_bytes(), motion_of(studio), set(disk.iterdir())
        fill(disk / "filling")
        with pytest.raises(ChoreographError, match=r"space|written|write") as refused:
            studio.edit(2, [Swap(6.0, 8.0)])
        assert "\n" not in str(refused.value) and studio.project.revision == 2
        assert studio.file.read_bytes() == saved and is_same(motion_of(studio), shown)
        assert set(disk.iterdir()) == before | {disk / "filling"}
        (disk / "filling").unlink()
        studio.edit(2, [Swap(6.0, 8.0)])
        last = motion_of(studio)
        studio.close()
        again.open(disk / "clicks.wav")
        again.load(None, None)
        assert is_same(motion_of(again), last) and again.project.revision == 3
    finally:
        for one in sessions:
            one.close()


# Repertoires by name: that of the command line, the built-in one, and those of the folder, nothing else.


def test_repertoires_are_found_by_name(repertoire, tmp_path):
    (tmp_path / "mine.h5").write_bytes(repertoire.path.read_bytes())
    repertoires = Repertoires(repertoire)
    assert repertoires.names(tmp_path) == [repertoire.path.name, "starter.h5", "mine.h5"]
    assert repertoires.open("", tmp_path) is repertoire is repertoires.open(repertoire.path.name, tmp_path)
    assert repertoires.open("mine.h5", tmp_path) is repertoires.open("mine.h5", tmp_path)
    assert len(repertoires.open("starter.h5", tmp_path).takes) > 100


@pytest.mark.parametrize("name", ["other.h5", "../mine.h5", "/etc/passwd", "mine.json", "a/mine.h5"])
def test_other_names_are_refused(name, repertoire, tmp_path):
    with pytest.raises(NotFoundError, match="--db"):
        Repertoires(repertoire).open(name, tmp_path)


def test_a_damaged_one_is_refused(repertoire, tmp_path):
    (tmp_path / "mine.h5").write_bytes(b"no repertoire")
    with pytest.raises(RepertoireError):
        Repertoires(repertoire).open("mine.h5", tmp_path)
