"""Writes a dance as an MP4 of the mannequin, with a camera that follows it, and the song."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.files import atomic_path, check_apart, check_target
from choreograph.core.progress import ProgressReport
from choreograph.core.timebase import frame_times_s, seconds_to_frames
from choreograph.formats.writer import DANCE_GENERATOR
from choreograph.motion.cameras import CameraPath
from choreograph.motion.motion import Motion
from choreograph.view.renderer import Pixels, Shots, shots_of
from choreograph.view.sound import Clicks, SongPart, aac_packets, aac_stream, silent_part, song_part

# The first encoder of the installed PyAV is used. H.264 plays everywhere, and "mpeg4" is in every build.
_ENCODERS = {
    # B-frames have a delay that an edit list compensates, which some players ignore.
    # The result depends on the number of threads, which must not depend on the machine. With macroblock-tree
    # rate control (mbtree), x264 reads memory that it has not set, so that some results differ.
    "libx264": {"preset": "veryfast", "crf": "25", "mbtree": "0", "bf": "0", "threads": "2"},
    "libopenh264": {"b": "6000000"},
    "mpeg4": {"b": "8000000", "threads": "1"},
}
_SMOOTHING_S = 0.7  # the camera does not follow faster movements
_RENDER_THREADS = min(4, os.cpu_count() or 1)
_LARGEST_PX = 4096
_MAX_FPS = 240.0
_BT709 = 1  # colour primaries, transfer and matrix of HD video


def write_video(
    path: str | Path,
    motion: Motion,
    *,
    song_path: str | Path | None = None,
    start_s: float = 0.0,
    clicks: Clicks | None = None,
    camera: CameraPath | None = None,
    duration_s: float | None = None,
    others: Sequence[Motion] = (),
    size: tuple[int, int] = (1280, 720),
    fps: float = 30.0,
    report: ProgressReport | None = None,
) -> str:
    """Film a motion and write it with its song. The same input gives the same bytes on one machine.

    Parameters
    ----------
    path : the file to write, atomically, which is an MP4 with any suffix
    motion : on any skeleton, with the floor at Y = 0
    song_path : the song file, used at its native rate. None makes a silent video
    start_s : time in the song at the first frame of the motion
    clicks : mixed into the song, or into silence
    camera : the cameras that film it. None follows the dancer
    duration_s : seconds to film from the start. None films the whole motion
    others : further dancers of a scene, with the length and the rate of `motion`
    size : width and height in pixels, both even
    fps : pictures per second. Picture i shows the motion at i / fps
    report : called with the name of the stage, the steps that are done and their total

    Returns
    -------
    encoder : str   "libx264", or its substitute in the installed PyAV

    Raises
    ------
    ParameterError     if size, fps or a time cannot be used, or the folder is missing
    FormatError        if the song cannot be read
    ChoreographError   if the disk is full or read-only
    """
    import av

    path = check_target(path)
    check_apart([path], [] if song_path is None else [song_path])
    duration_s = _checked(motion, duration_s, size, fps)
    n_frames = max(1, seconds_to_frames(duration_s, fps))
    times_s = np.minimum(frame_times_s(n_frames, fps), motion.duration_s)
    part = None
    if song_path is not None:
        part = song_part(song_path, start_s=start_s, duration_s=n_frames / fps)
    if clicks is not None:
        part = clicks.over(part or silent_part(n_frames / fps))
    shots = shots_of((motion, *others), times_s, aspect=size[0] / size[1], smoothing_s=_SMOOTHING_S)
    if camera is not None:
        eyes_m, targets_m = camera.at(times_s)
        shots = replace(shots, targets_m=targets_m, towards_eye_m=eyes_m - targets_m)
    try:
        with atomic_path(path) as temporary:
            return _encode(temporary, shots, part, size, fps, report)
    except av.FFmpegError as error:
        raise ChoreographError(f"cannot write {path}: {error.strerror or error}") from error


def _checked(motion: Motion, duration_s: float | None, size: tuple[int, int], fps: float) -> float:
    if not all(2 <= pixels <= _LARGEST_PX and pixels % 2 == 0 for pixels in size):
        raise ParameterError(
            f"expected an even width and height of 2 to {_LARGEST_PX} pixels, got {size[0]} x {size[1]}"
        )
    if not 0 < fps <= _MAX_FPS:
        raise ParameterError(f"expected up to {_MAX_FPS:g} pictures per second, got {fps:g}")
    if duration_s is None:
        return motion.duration_s
    if not 0 < duration_s <= motion.duration_s + 1 / fps:
        raise ParameterError(
            f"expected a duration within the motion's {motion.duration_s:.2f} s, got {duration_s:g}"
        )
    return duration_s


def _encode(
    path: Path,
    shots: Shots,
    part: SongPart | None,
    size: tuple[int, int],
    fps: float,
    report: ProgressReport | None,
) -> str:
    import av

    name = next(name for name in _ENCODERS if name in av.codecs_available)
    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        bitexact: Any = av.container.Flags.bitexact  # no version, no date
        container.flags |= bitexact.value
        container.metadata["comment"] = DANCE_GENERATOR
        rate = Fraction(fps).limit_denominator(1001)
        picture = _picture_stream(container, name, size, rate)
        packets: Iterator[Any] = iter(())
        if part is not None:
            packets = aac_packets(aac_stream(container, part), part)
        n_frames = len(shots.pos_m)
        for index, pixels in enumerate(_rendered(shots, size)):
            container.mux(picture.encode(_picture(pixels, index, rate)))
            _mux_until(container, packets, index / fps)
            if report is not None:
                report("video", index + 1, n_frames)
        container.mux(picture.encode(None))
        _mux_until(container, packets, np.inf)
    return name


def _rendered(shots: Shots, size: tuple[int, int]) -> Iterator[Pixels]:
    """The pictures in order. Other threads render the next ones while one is encoded."""
    with ThreadPoolExecutor(max_workers=_RENDER_THREADS) as pool:
        drawn: deque[Future[Pixels]] = deque()
        for index in range(len(shots.pos_m)):
            drawn.append(pool.submit(shots.render, index, size))
            if len(drawn) > 2 * _RENDER_THREADS:
                yield drawn.popleft().result()
        while drawn:
            yield drawn.popleft().result()


def _picture_stream(container: Any, name: str, size: tuple[int, int], rate: Fraction) -> Any:
    stream = container.add_stream(name, rate=rate, options=_ENCODERS[name])
    stream.width, stream.height = size
    stream.pix_fmt = "yuv420p"
    context = stream.codec_context
    context.time_base = 1 / rate
    context.color_primaries = context.color_trc = context.colorspace = _BT709
    return stream


def _picture(pixels: Pixels, index: int, rate: Fraction) -> Any:
    import av

    frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
    frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709")
    frame.pts, frame.time_base = index, 1 / rate
    return frame


def _mux_until(container: Any, packets: Iterator[Any], time_s: float) -> None:
    """Write the packets of the sound up to a time, so that sound and pictures are interleaved in the file."""
    for packet in packets:
        container.mux(packet)
        if packet.pts is not None and packet.pts * packet.time_base > time_s:
            return
