"""The MP4: number and timing of pictures and sound; errors."""

from __future__ import annotations

import io
import resource
from dataclasses import replace
from fractions import Fraction

import av
import numpy as np
import pytest
import soundfile
from synthetic_motions import swaying

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.cameras import CameraPath, plan_cameras
from choreograph.motion.motion import Motion
from choreograph.view.video import _picture, _picture_stream, write_video

SIZE = (96, 64)
MOTION = swaying(60, fps=30.0)


def decoded(path):
    """Pictures (N, H, W, 3) with their times, and sound (S, C) with the first sample's time and rate."""
    with av.open(str(path)) as container:
        frames = list(container.decode(video=0))
        pictures = np.stack([frame.to_ndarray(format="rgb24") for frame in frames])
        times = np.array([frame.time for frame in frames])
    with av.open(str(path)) as container:
        if not container.streams.audio:
            return pictures, times, None, 0.0, 0
        rate = container.streams.audio[0].rate
        blocks = list(container.decode(audio=0))
        sound = np.concatenate([block.to_ndarray() for block in blocks], axis=1).T
        return pictures, times, sound, blocks[0].time, rate


@pytest.fixture(scope="module")
def clicks(tmp_path_factory):
    """A stereo song at 44.1 kHz, silent but for a click at every full second."""
    rate = 44100
    sound = np.zeros((8 * rate, 2), np.float32)
    for second in range(8):
        burst = np.sin(2 * np.pi * 2000 * np.arange(400) / rate) * np.hanning(400)
        sound[second * rate : second * rate + 400] = 0.8 * burst[:, None]
    path = tmp_path_factory.mktemp("songs") / "clicks.wav"
    soundfile.write(path, sound, rate)
    return path


def test_silent_video(tmp_path):
    seen = []
    name = write_video(
        tmp_path / "d.mp4", MOTION, size=SIZE, fps=15, report=lambda *stage: seen.append(stage)
    )
    pictures, times, sound, _, _ = decoded(tmp_path / "d.mp4")
    assert name in av.codecs_available
    assert pictures.shape == (30, 64, 96, 3) and sound is None
    assert np.allclose(times, np.arange(30) / 15, atol=1e-3)
    assert seen == [("video", done, 30) for done in range(1, 31)]
    assert list(tmp_path.iterdir()) == [tmp_path / "d.mp4"]


def test_sound_is_the_danced_part_at_its_native_rate(tmp_path, clicks):
    write_video(tmp_path / "d.mp4", MOTION, song_path=clicks, start_s=2.25, size=SIZE, fps=10)
    pictures, _, sound, start, rate = decoded(tmp_path / "d.mp4")
    assert len(pictures) == 20 and rate == 44100 and sound.shape[1] == 2
    assert len(sound) / rate == pytest.approx(2.0, abs=0.05)
    loud = np.flatnonzero(np.abs(sound).max(axis=1) > 0.4) / rate + start
    assert loud[0] == pytest.approx(0.75, abs=0.01)
    assert loud[loud > 1.0][0] == pytest.approx(1.75, abs=0.01)


def test_pictures_and_sound_are_in_sync(tmp_path, clicks):
    n = 90
    quat = np.tile(MOTION.local_quat[:1] * 0 + rot.IDENTITY, (n, 1, 1))
    raised = rot.from_rotvec(np.array([0.0, 0.0, 1.3]))
    quat[31:, MOTION.skeleton.index("left_shoulder")] = raised  # from 1 + 1/30 s on, seen from 1 s on
    jump = Motion(MOTION.skeleton, np.tile([[0.0, 0.93, 0.0]], (n, 1)), quat, 30.0)
    write_video(tmp_path / "d.mp4", jump, song_path=clicks, start_s=3.0, size=(192, 128), fps=30)
    pictures, times, sound, start, rate = decoded(tmp_path / "d.mp4")
    change = np.abs(np.diff(pictures.astype(int), axis=0)).mean(axis=(1, 2, 3))
    seen_s = times[1:][change.argmax()]
    loud = np.flatnonzero(np.abs(sound).max(axis=1) > 0.4) / rate + start
    heard_s = loud[loud > 0.5][0]
    assert change.max() > 5 * np.median(change) + 0.2
    assert abs(seen_s - 1 / 30 - heard_s) < 0.02


def test_the_same_input_gives_the_same_bytes(tmp_path, clicks):
    files = [tmp_path / "a.mp4", tmp_path / "b.mp4"]
    for file in files:
        write_video(file, MOTION, song_path=clicks, duration_s=0.5, size=SIZE)
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.skipif("libx264" not in av.codecs_available, reason="this build of PyAV has no x264")
def test_the_encoder_gives_the_same_bytes_every_time():
    """x264 with its own defaults gives other bytes in 2 to 5 of 100 times."""
    rng = np.random.default_rng(0)
    pictures = [rng.integers(0, 256, (SIZE[1] // 8, SIZE[0] // 8, 3), np.uint8) for _ in range(15)]
    frames = [
        _picture(np.kron(pixels, np.ones((8, 8, 1), np.uint8)), i, Fraction(30))
        for i, pixels in enumerate(pictures)
    ]
    found = set()
    for _ in range(150):
        with av.open(io.BytesIO(), "w", format="mp4") as container:
            stream = _picture_stream(container, "libx264", SIZE, Fraction(30))
            packets = [packet for frame in (*frames, None) for packet in stream.encode(frame)]
            found.add(b"".join(map(bytes, packets)))
    assert len(found) == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"size": (95, 64)}, "even width"),
        ({"size": (96, 0)}, "even width"),
        ({"fps": 0}, "pictures per second"),
        ({"fps": float("nan")}, "pictures per second"),
        ({"duration_s": 99.0}, "within the motion"),
        ({"duration_s": 0.0}, "within the motion"),
    ],
)
def test_wrong_input_is_a_one_line_error(tmp_path, changes, message):
    with pytest.raises(ParameterError, match=message) as caught:
        write_video(tmp_path / "d.mp4", MOTION, **{"size": SIZE} | changes)
    assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())


def test_missing_folder_and_a_file_that_is_no_song(tmp_path):
    with pytest.raises(ParameterError, match="no folder"):
        write_video(tmp_path / "none" / "d.mp4", MOTION, size=SIZE)
    (tmp_path / "song.mp3").write_bytes(b"this is no sound" * 100)
    with pytest.raises(FormatError, match="song"):
        write_video(tmp_path / "d.mp4", MOTION, song_path=tmp_path / "song.mp3", size=SIZE)
    assert [path.name for path in tmp_path.iterdir()] == ["song.mp3"]


def test_unwritable_target_is_a_one_line_error_and_leaves_no_file(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))  # bytes of a file, as on a full disk
    try:
        with pytest.raises(ChoreographError, match="File too large") as caught:
            write_video(tmp_path / "d.mp4", MOTION, size=SIZE)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())
    assert str(caught.value).startswith(f"cannot write {tmp_path / 'd.mp4'}: ")


def test_fallback_encoder(tmp_path, monkeypatch):
    monkeypatch.setattr(av, "codecs_available", {"mpeg4", "aac"})
    short = replace(MOTION, root_pos_m=MOTION.root_pos_m[:6], local_quat=MOTION.local_quat[:6])
    assert write_video(tmp_path / "d.mp4", short, size=SIZE) == "mpeg4"
    assert len(decoded(tmp_path / "d.mp4")[0]) == 6


def test_a_video_is_filmed_by_the_cameras(tmp_path):
    still = MOTION.sampled(np.zeros(60))
    path = plan_cameras([still], "front")
    cut_s = 1.0
    near = replace(
        path.shots[0], start_s=cut_s, times_s=np.array([cut_s, 2.0]),
        eye_m=path.shots[0].eye_m * 0.7 + path.shots[0].target_m * 0.3,
    )  # fmt: skip
    cut = CameraPath((replace(path.shots[0], end_s=cut_s), near))
    write_video(tmp_path / "d.mp4", still, size=SIZE, fps=15, camera=cut)
    pictures, times, *_ = decoded(tmp_path / "d.mp4")
    change = np.abs(np.diff(pictures.astype(float), axis=0)).mean(axis=(1, 2, 3))
    assert times[1 + np.argmax(change)] == pytest.approx(cut_s)
    assert change.max() > 4 * np.sort(change)[-2]
