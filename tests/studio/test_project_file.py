"""The file of a project: whole or not at all, used by one process, and names that are no paths."""

from __future__ import annotations

import os

import pytest

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.studio.project import Project
from choreograph.studio.project_file import ProjectFile, checked_name, opened, placed, project_path
from choreograph.studio.refusals import UnknownTypeError


def test_what_is_written_is_read(tmp_path):
    file = ProjectFile(tmp_path / "a.studio.json")
    assert file.read() is None
    file.write(Project("a.wav", revision=3))
    assert file.read() == Project("a.wav", revision=3)
    file.close()
    assert os.listdir(tmp_path) == ["a.studio.json"]


def test_a_second_studio_is_refused_until_the_first_is_closed(tmp_path):
    path = tmp_path / "a.studio.json"
    file = ProjectFile(path)
    with pytest.raises(ChoreographError, match="studio"):
        ProjectFile(path)
    file.close()
    ProjectFile(path).close()


def test_a_full_disk_leaves_the_file_before_it(tmp_path, monkeypatch):
    file = ProjectFile(tmp_path / "a.studio.json")
    file.write(Project("a.wav", revision=3))

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ChoreographError, match="No space"):
        file.write(Project("a.wav", revision=4))
    assert file.read().revision == 3
    file.close()
    assert os.listdir(tmp_path) == ["a.studio.json"]


def test_a_damaged_file_is_refused(tmp_path):
    (tmp_path / "a.studio.json").write_text("{}")
    file = ProjectFile(tmp_path / "a.studio.json")
    with pytest.raises(FormatError):
        file.read()
    file.close()


def test_a_link_leads_to_one_project_with_one_lock_and_stays_a_link(tmp_path):
    for name in ("real", "other"):
        (tmp_path / name).mkdir()
    real, link = tmp_path / "real" / "a.studio.json", tmp_path / "other" / "b.studio.json"
    link.symlink_to(real)
    file = ProjectFile(link)
    file.write(Project("a.wav", revision=3))  # before there is a file, and over it
    file.write(Project("a.wav", revision=4))
    assert link.is_symlink() and os.listdir(link.parent) == ["b.studio.json"]
    with pytest.raises(ChoreographError, match="studio"):
        ProjectFile(real)
    assert opened(real, "a.wav", file) == (file, Project("a.wav", revision=4))
    file.close()
    assert ProjectFile(real).read().revision == 4


def test_a_link_to_nowhere_makes_no_folders(tmp_path):
    link = tmp_path / "a.studio.json"
    link.symlink_to(tmp_path / "none" / "a.studio.json")
    with pytest.raises(ChoreographError, match="there is no folder"):
        ProjectFile(link)
    link.unlink()
    link.symlink_to(link)
    with pytest.raises(ChoreographError):
        ProjectFile(link).read()
    assert not (tmp_path / "none").exists()


def test_the_project_is_beside_its_song(tmp_path):
    assert project_path(tmp_path / "my song.mp3") == tmp_path / "my song.studio.json"


@pytest.mark.parametrize(
    "name",
    [
        "", ".", "..", "../a.wav", "a/b.wav", "a\\b.wav", "/etc/a.wav", "C:a.wav", ".hidden.wav", "a.wav.",
        "a\x00.wav", "a\n.wav", " a.wav", "a.wav ", "a*.wav", "a" * 200 + ".wav", "con?.wav",
        "con.wav", "NUL.wav", "com1.x.wav", "a\x85.wav", "a\u2028.wav",
    ],
)  # fmt: skip
def test_names_are_never_paths(name):
    with pytest.raises(ParameterError):
        checked_name(name, [".wav"])


@pytest.mark.parametrize("name", ["a.wav", "Ä song, 2.WAV", "歌.wav", "a.b.wav", "console.wav"])
def test_plain_names_are_taken(name):
    assert checked_name(name, [".wav"]) == name


def test_another_suffix_is_refused():
    with pytest.raises(UnknownTypeError):
        checked_name("a.exe", [".wav"])


def test_a_file_never_replaces_another(tmp_path):
    (tmp_path / "in").mkdir()
    for content, expected in (
        (b"1", "a.wav"), (b"1", "a.wav"), (b"2", "a-new.wav"), (b"3", "a-new-2.wav"), (b"2", "a-new.wav"),
    ):  # fmt: skip
        sent = tmp_path / "in" / "a.wav"
        sent.write_bytes(content)
        path = placed(sent, tmp_path)
        assert path.name == expected and path.read_bytes() == content and not sent.exists()
