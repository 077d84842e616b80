"""Files beside takes that are not read are listed with the reason; the sound of a video is a take's song."""

from __future__ import annotations

import av
import numpy as np
import pytest
from command_line import assert_one_line, run
from synthetic_motions import swaying
from synthetic_repertoire import write_clicks

from choreograph.formats.fbx import VARIABLE
from choreograph.formats.register import import_takes, save_motion
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import import_sources
from choreograph.library.notes import summary
from choreograph.music.song import load_song


def source_notes(folder):
    """The notes on the files of a folder that gave no take."""
    imported = import_sources([folder], BuildOptions(), None)
    notes = [note for note in imported.notes() if note.kind != "import"]
    return summary(notes, len(imported.takes), "a.h5")


def write_video(path, *, sound: bool) -> None:
    """A second of video, with or without a click in it."""
    with av.open(str(path), "w") as container:
        picture = container.add_stream("mpeg4", rate=10)
        picture.width = picture.height = 32
        tone = container.add_stream("aac", rate=48000) if sound else None
        for _ in range(10):
            frame = av.VideoFrame.from_ndarray(np.zeros((32, 32, 3), np.uint8), format="rgb24")
            container.mux(picture.encode(frame))
        container.mux(picture.encode(None))
        if tone is not None:
            samples = (8000 * np.sin(np.arange(48000) / 20)).astype(np.int16)[None]
            for start in range(0, 48000, 960):
                part = av.AudioFrame.from_ndarray(
                    samples[:, start : start + 960], format="s16", layout="mono"
                )
                part.rate, part.pts = 48000, start
                container.mux(tone.encode(part))
            container.mux(tone.encode(None))


@pytest.fixture
def folder(tmp_path):
    save_motion(tmp_path / "a.bvh", swaying(60))
    return tmp_path


def test_a_mixed_folder_lists_what_it_skipped_and_why(folder, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(folder / "nothing"))  # no Blender
    for name in ("b.x", "c.x", "d.fbx", "e.usdz", "f.mp3", "readme.txt", ".a.bvh"):
        (folder / name).write_bytes(b"x")
    (folder / "more").mkdir()
    save_motion(folder / "more" / "g.bvh", swaying(4))
    notes = source_notes(folder)
    assert [take.name for take in import_takes(folder)] == ["a"]
    assert len(notes) == 6 and "prints all 6 notes" in notes[-1]
    assert any("2 files: " in note and "(b.x, c.x)" in note and "DirectX" in note for note in notes)
    for name in ("d.fbx", "e.usdz", "f.mp3", "more/g.bvh"):
        assert sum(name in note for note in notes) == 1, name
    assert not any("readme" in note or ".a.bvh" in note for note in notes)


def test_many_files_are_counted(folder):
    for number in range(40):
        (folder / f"{number:02}.x").write_bytes(b"x")
    note, more = source_notes(folder)
    assert "40 files" in note and "and 37 more" in note and len(note) < 300 and "all 40 notes" in more


def test_a_folder_of_takes_alone_has_nothing_to_say(folder):
    write_clicks(folder / "a.wav", duration_s=2.0)
    (folder / "manifest.csv").write_text("name,genre\na,waltz\n")
    assert source_notes(folder) == ()


@pytest.mark.parametrize(
    ("name", "says"),
    [("a.x", "DirectX"), ("a.usdc", "Universal Scene"), ("a.blend", "BVH from Blender")],
)
def test_one_file_that_is_not_read_is_named_with_what_to_do(tmp_path, monkeypatch, name, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_bytes(b"x")
    assert_one_line(run("convert", name, "b.bvh"), says=says)
    assert_one_line(run("build-db", name, "-o", "rep.h5"), says=says)


def test_the_sound_of_a_video_beside_motion_is_its_song(folder):
    write_video(folder / "a.mp4", sound=True)
    (take,) = import_takes(folder)
    assert take.song_path == folder / "a.mp4"
    assert load_song(take.song_path).duration_s == pytest.approx(1.0, abs=0.05)
    write_clicks(folder / "a.wav", duration_s=2.0)
    (take,) = import_takes(folder)
    assert take.song_path == folder / "a.wav"  # a song of its own comes first


def test_a_video_without_sound_is_no_song(folder):
    write_video(folder / "a.mp4", sound=False)
    (take,) = import_takes(folder)
    assert take.song_path is None
    assert "without sound" in source_notes(folder)[0]
