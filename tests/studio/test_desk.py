"""The desk: changes are local, saved before they are shown, and come back to the same bytes."""

from __future__ import annotations

import numpy as np
import pytest
from faults.injection import small_disk

from choreograph.choreography.edits import Repeat, Swap, Vary, slot_bounds_s
from choreograph.core.errors import ChoreographError, ParameterError, RepertoireError
from choreograph.library.repertoire import starter_repertoire
from choreograph.render.rendering import render
from choreograph.studio.desk import Desk, Shelf
from choreograph.studio.project import ProjectFile
from choreograph.studio.refusals import ConflictError, NotFoundError
from choreograph.studio.steps import StepDances

# The desk: changes are local, saved before they are shown, and come back to the same bytes.


def motion_of(desk):
    motion = desk.state.dance.motion
    return np.concatenate([motion.root_pos_m[:, None], motion.local_quat[..., 1:]], axis=1)


def is_same(a, b):
    return a.tobytes() == b.tobytes()


def test_the_first_dance_is_made_and_saved(desk, folder):
    assert desk.project.revision == 1 and desk.file == folder / "clicks.studio.json"
    assert desk.file.exists() and not desk.project.can_undo


def test_an_edit_changes_its_span_and_two_beats_alone(desk):
    before = motion_of(desk)
    desk.edit(1, [Swap(4.0, 6.0)])
    changed = np.flatnonzero((motion_of(desk) != before).any(axis=(1, 2))) / 60
    beat_s = np.median(np.diff(slot_bounds_s(desk.state.dance.plan)))
    assert 4.0 - 2.1 * beat_s <= changed.min() and changed.max() <= 6.0 + 2.1 * beat_s
    [(start_s, end_s)] = desk.state.changed
    assert start_s <= changed.min() + 0.05 and changed.max() - 0.05 <= end_s


def test_a_chain_of_changes_comes_back_from_the_file_and_can_be_undone(desk, open_desk, repertoire):
    shown = [motion_of(desk)]
    for one in (Swap(2.0, 4.0), Vary(7.0, 9.0), Repeat(2.0, 4.0, 8.0, mirrored=True)):
        desk.edit(desk.project.revision, [one], seed=1)
        shown.append(motion_of(desk))
    desk.change_settings(desk.project.revision, {"seed": 5})
    shown.append(motion_of(desk))
    desk.edit(desk.project.revision, [Swap(5.0, 6.0)])
    shown.append(motion_of(desk))
    desk.close()
    again = open_desk()
    assert is_same(motion_of(again), shown[-1])
    plan = again.state.dance.plan
    assert is_same(render(plan, repertoire).local_quat, again.state.dance.motion.local_quat)
    for expected in shown[-2::-1]:
        again.move(again.project.revision, back=True)
        assert is_same(motion_of(again), expected)
    for expected in shown[1:]:
        again.move(again.project.revision, back=False)
        assert is_same(motion_of(again), expected)


def test_undo_without_motions_in_memory_renders_the_same(desk):
    before = motion_of(desk)
    desk.edit(1, [Swap(2.0, 4.0)])
    after = motion_of(desk)
    desk._dances = StepDances(desk.state.repertoire)
    desk.move(2, back=True)
    assert is_same(motion_of(desk), before)
    desk.move(3, back=False)
    assert is_same(motion_of(desk), after)


def test_locked_parts_are_kept_when_the_dance_is_made_again(desk):
    desk.lock(1, [(2.0, 6.0)])
    before = motion_of(desk)
    desk.change_settings(2, {"seed": 3})
    same = (motion_of(desk) == before).all(axis=(1, 2))
    assert same[121:359].all() and not same[400:].all()
    desk.change_settings(3, {"seed": 4}, keep_locked=False)
    assert not (motion_of(desk) == before)[121:359].all()


def test_a_locked_part_is_not_edited(desk):
    desk.lock(1, [(4.0, 6.0)])
    before = motion_of(desk)
    with pytest.raises(ParameterError, match="locked"):
        desk.edit(2, [Swap(5.0, 8.0)])
    assert is_same(motion_of(desk), before) and desk.project.revision == 2
    desk.edit(2, [Swap(8.0, 10.0)])


def test_a_span_is_made_again_with_a_setting_of_its_own(desk):
    before = motion_of(desk)
    desk.change_settings(1, {"seed": 7}, span=(4.0, 8.0))
    same = (motion_of(desk) == before).all(axis=(1, 2))
    assert same[:239].all() and same[481:].all() and not same.all()
    assert desk.project.settings.seed == 0


def test_an_old_revision_is_refused(desk):
    desk.edit(1, [Swap(4.0, 6.0)])
    for change in (
        lambda: desk.edit(1, [Swap(4.0, 6.0)]), lambda: desk.change_settings(1, {}), lambda: desk.lock(1, []),
        lambda: desk.move(1, back=True), lambda: desk.choose(1, "1-0"),
        lambda: desk.alternatives(1, (2, 4), 2),
    ):  # fmt: skip
        with pytest.raises(ConflictError):
            change()
    assert desk.project.revision == 2


def test_what_cannot_be_written_is_not_shown(desk, monkeypatch):
    before, state = desk.file.read_bytes(), desk.state

    def full(file, project):
        raise ChoreographError("cannot write: no space left")

    with monkeypatch.context() as patch:
        patch.setattr(ProjectFile, "write", full)
        for change in (lambda: desk.edit(1, [Swap(4.0, 6.0)]), lambda: desk.change_settings(1, {"seed": 1})):
            with pytest.raises(ChoreographError, match="space"):
                change()
            assert desk.state is state and desk.file.read_bytes() == before
    desk.edit(1, [Swap(4.0, 6.0)])
    assert desk.project.revision == 2


def test_alternatives_are_small_differ_and_one_is_chosen(folder):
    """With the built-in takes, since the synthetic ones are too similar."""
    desk = Desk(folder, starter_repertoire())
    desk.open(folder / "clicks.wav")
    desk.load(None, None)
    found = desk.alternatives(1, (4.0, 6.0), 3)
    assert 1 <= len(found) <= 3 and [one["cost"] for one in found] == sorted(one["cost"] for one in found)
    assert all(one["facts"]["fps"] == 20 and one["why"] and len(one["motion"]) < 20_000 for one in found)
    before = motion_of(desk)
    desk.choose(1, found[-1]["id"])
    assert not is_same(motion_of(desk), before)
    assert desk.state.dance.plan.edits[-1].words[0].start_s == found[-1]["start_s"]
    with pytest.raises(NotFoundError):
        desk.choose(2, found[0]["id"])
    desk.close()


def test_a_part_of_a_take_is_pinned_from_the_nearest_count(desk, repertoire):
    take = repertoire.takes[0]
    for source_s in (3.0, 6.0):
        desk.pin_part(desk.project.revision, (5.0, 7.0), take.name, source_s)
        words = desk.state.dance.plan.edits[-1].words
        begun = next(word for word in words if word.start_s >= 5.0 - 0.3 and word is not words[0])
        assert {word.take for word in words} == {take.name}
        assert abs(begun.source_start_s - source_s) < 1.0
    with pytest.raises(ChoreographError):
        desk.pin_part(desk.project.revision, (5.0, 7.0), "none", 3.0)


def test_a_ban_stays_when_the_dance_is_made_again(desk):
    take = next(iter(desk.state.dance.plan.takes_s()))
    from choreograph.choreography.constraints import Ban

    desk.edit(1, [Ban(take=take)], bans=[f"take:{take}"])
    desk.change_settings(2, {"seed": 1})
    assert take not in desk.state.dance.plan.takes_s() and desk.project.settings.bans == (f"take:{take}",)


def test_the_mixer_dances_with_weights_of_the_graph(desk):
    desk.change_settings(1, {"weights": {"pace": 2.0}})
    with pytest.raises(ChoreographError):
        desk.change_settings(2, {"weights": {"nothing": 2.0}})
    assert desk.project.revision == 2


def test_versions_are_dances_of_their_own(desk):
    desk.keep_version("A")
    first = motion_of(desk)
    desk.edit(desk.project.revision, [Swap(4.0, 6.0)])
    desk.keep_version("B")
    step, dance = desk.version("A")
    assert step.number == 1 and is_same(dance.motion.local_quat[..., 1:], first[:, 1:])
    assert desk.facts("A")["edits"] == [] and len(desk.facts("B")["edits"]) == 1
    with pytest.raises(NotFoundError):
        desk.version("C")


def test_a_project_of_another_song_is_refused(desk, folder, repertoire):
    desk.close()
    (folder / "other.wav").write_bytes((folder / "clicks.wav").read_bytes())
    other = Desk(folder, repertoire)
    with pytest.raises(ChoreographError, match=r"clicks\.wav"):
        other.open(folder / "other.wav", folder / "clicks.studio.json")
    with pytest.raises(ParameterError, match="beside its song"):
        other.open(folder / "other.wav", folder.parent / "x.studio.json")


def test_without_a_song_there_is_no_dance(repertoire, tmp_path):
    desk = Desk(tmp_path, repertoire)
    for ask in (desk.current, desk.song, lambda: desk.lock(0, [])):
        with pytest.raises(NotFoundError):
            ask()
    desk.change_settings(0, {"seed": 4})
    assert desk.project.settings.seed == 4


@pytest.mark.slow
def test_a_dance_of_the_network_is_made_edited_undone_and_opened_again(folder):
    """A rollout cannot be rendered from its plan. It is made again with its settings, to the same bytes."""

    def opened():
        desk = Desk(folder, starter_repertoire())
        desk.open(folder / "clicks.wav")
        desk.load(None, None)
        return desk

    desk = opened()
    desk.change_settings(1, {"engine": "rollout", "seed": 2})
    generated = motion_of(desk)
    assert desk.state.dance.plan.engine == "rollout" and not desk.state.dance.plan.from_takes
    desk.edit(2, [Swap(4.0, 6.0)])
    edited = motion_of(desk)
    same = (edited == generated).all(axis=(1, 2))
    assert same[: 3 * 60].all() and same[8 * 60 :].all() and not same[5 * 60]
    desk.lock(3, [(8.0, 10.0)])
    with pytest.raises(ParameterError, match="rollout, which generates whole dances"):
        desk.change_settings(4, {"seed": 3})
    with pytest.raises(ParameterError, match="whose takes are not known"):
        desk.edit(4, [Repeat(2.0, 3.0, 5.0)])
    desk.close()
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
    desks = [Desk(disk, repertoire), Desk(disk, repertoire)]
    try:
        desk, again = desks
        desk.open(disk / "clicks.wav")
        desk.load(None, None)
        desk.edit(1, [Swap(2.0, 4.0)])
        saved, shown, before = desk.file.read_bytes(), motion_of(desk), set(disk.iterdir())
        fill(disk / "filling")
        with pytest.raises(ChoreographError, match=r"space|written|write") as refused:
            desk.edit(2, [Swap(6.0, 8.0)])
        assert "\n" not in str(refused.value) and desk.project.revision == 2
        assert desk.file.read_bytes() == saved and is_same(motion_of(desk), shown)
        assert set(disk.iterdir()) == before | {disk / "filling"}
        (disk / "filling").unlink()
        desk.edit(2, [Swap(6.0, 8.0)])
        last = motion_of(desk)
        desk.close()
        again.open(disk / "clicks.wav")
        again.load(None, None)
        assert is_same(motion_of(again), last) and again.project.revision == 3
    finally:
        for one in desks:
            one.close()


# Repertoires by name: that of the command line, the built-in one, and those of the folder, nothing else.


def test_repertoires_are_found_by_name(repertoire, tmp_path):
    (tmp_path / "mine.h5").write_bytes(repertoire.path.read_bytes())
    shelf = Shelf(repertoire)
    assert shelf.names(tmp_path) == [repertoire.path.name, "starter.h5", "mine.h5"]
    assert shelf.open("", tmp_path) is repertoire is shelf.open(repertoire.path.name, tmp_path)
    assert shelf.open("mine.h5", tmp_path) is shelf.open("mine.h5", tmp_path)
    assert len(shelf.open("starter.h5", tmp_path).takes) > 100


@pytest.mark.parametrize("name", ["other.h5", "../mine.h5", "/etc/passwd", "mine.json", "a/mine.h5"])
def test_other_names_are_refused(name, repertoire, tmp_path):
    with pytest.raises(NotFoundError, match="--db"):
        Shelf(repertoire).open(name, tmp_path)


def test_a_damaged_one_is_refused(repertoire, tmp_path):
    (tmp_path / "mine.h5").write_bytes(b"no repertoire")
    with pytest.raises(RepertoireError):
        Shelf(repertoire).open("mine.h5", tmp_path)
