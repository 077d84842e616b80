"""The preview page: one HTML file with the dance, its song and a player, for any browser, offline.

The page has its own small WebGL renderer for the mannequin (`page/renderer.js` and its imports, 600 lines). A
general engine would add 0.2 MB to every page to draw one skinned body, a floor and a shadow. Characters of
users, which have materials of any kind, are drawn by three.js (`page_data`).

The parts of the page are in `page/`: ES modules, which are bundled in the order of `_SCRIPTS`, a style sheet
and the template. Only the data differs between dances: JSON, and compressed bytes in base64.

The page has a read-only state for scripts, `window.choreograph`:

- time, duration, and shownFrom and shownTo of the timeline, in seconds, and audioTime, null without sound
- frame, fps, framesDrawn, and pixelScale, which is below 1 on slow machines
- playing, speed, loop {on, from, to}, mirrored, following
- shot, the name of the current shot of the cameras, or null without cameras or if the viewer has turned
- take, the name of the current take, and count, the current {bar, number} or null
- dancers, for each dancer of a scene its `joints`
- joints, J positions [x, y, z] in metres, as in `motion.joint_pos_m()`, or those of the bones of the
  character that are known, in canonical order
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.files import atomic_path, check_apart, check_target
from choreograph.core.progress import StepReport, part
from choreograph.formats.writer import DANCE_GENERATOR
from choreograph.motion.cameras import CameraPath
from choreograph.motion.motion import Motion
from choreograph.plan.plan import Block, Plan, PlannedSecond
from choreograph.view.page_data import (
    PageBody,
    PageCharacter,
    bundle_scripts,
    character_body,
    deflate_base64,
    filled_pieces,
    mannequin_body,
    page_part,
    to_script_json,
)
from choreograph.view.sound import Levels, encode_mp4, song_part

_SCRIPTS = (
    "math.js", "decompress.js", "ground_path.js", "clock.js", "film.js", "camera.js", "shaders.js",
    "stage_colours.js", "resolution.js", "stage.js", "orbit.js", "colours.js", "gestures.js", "counts.js",
    "timeline.js", "elements.js", "card.js", "player.js", "controls.js", "page.js",
)  # fmt: skip
_STEPS = 100  # of its progress
_LEVELS_PER_S = 50
_NETWORK = "rollout network"  # shown instead of the name of a take
_WRITTEN_AT_ONCE = 1 << 20  # characters
_LENGTH_SLACK_S = 0.1  # the plan has the song's length, the motion a whole number of frames


def write_page(
    path: str | Path,
    motion: Motion,
    plan: Plan,
    *,
    song_path: str | Path | None,
    motion_beats_s: Sequence[float] | NDArray[np.floating],
    start_s: float | None = None,
    duration_s: float | None = None,
    title: str | None = None,
    character: PageCharacter | None = None,
    others: Sequence[Motion] = (),
    camera: CameraPath | None = None,
    report: StepReport | None = None,
) -> None:
    """Write the dance as one self-contained HTML file. The same dance gives the same bytes.

    Parameters
    ----------
    path : the file to write, atomically
    motion, plan : of one dance. The timeline shows the blocks of the plan
    song_path : the song file, whose danced part is embedded. None makes a silent page
    motion_beats_s : (Q,) increasing times in the dance
    start_s : start of the dance in the song file. None uses `start_s` of the plan
    duration_s : seconds to show from the start. None shows the whole motion
    title : heading of the page. None uses the name of the song
    character : the character that dances. None uses the mannequin
    others : further dancers of a scene on mannequins, with the length and the skeleton of `motion`
    camera : the cameras that film it, until the viewer turns the view. None follows the dancer
    report : called with the steps that are done and their total

    Raises
    ------
    ParameterError     if the folder is missing, motion and plan differ in length, a time is out of range, or
                       the character is compressed or larger than 100 MB
    FormatError        if the song cannot be read
    ChoreographError   if the disk is full or read-only
    """
    path = check_target(path)
    check_apart([path], [] if song_path is None else [song_path])
    beats_s = _checked_beats(motion_beats_s)
    duration_s = _checked_duration(motion, plan, duration_s)
    start_s = plan.start_s if start_s is None else start_s
    if character is None:
        end = int(np.ceil(duration_s * motion.fps)) + 1
        shown_motions = [one.sliced(0, min(one.n_frames, end)) for one in (motion, *others)]
        body = mannequin_body(shown_motions[0], shown_motions[1:])
    else:
        body = character_body(character, motion.fps)
    if report is not None:
        report(30, _STEPS)
    sound, levels, levels_per_s = _sound(song_path, start_s, duration_s, part(report, 30, 95, _STEPS))
    title = title or plan.song or "Dance"
    shown = dance_facts(plan, duration_s, title=title, motion_beats_s=beats_s)
    head = {name: shown.pop(name) for name in ("title", "duration_s")}
    filmed = {} if camera is None else {"shots": camera_facts(camera)}
    dance = {**head, **body.facts, "levels_per_s": levels_per_s, **shown, **filmed}
    text = _page_text(title, body, to_script_json(dance), levels, sound)
    with (
        atomic_path(path) as temporary,
        temporary.open("w", encoding="utf-8", errors="replace", newline="\n") as file,
    ):
        for piece in text:
            for begin in range(0, len(piece), _WRITTEN_AT_ONCE):
                file.write(piece[begin : begin + _WRITTEN_AT_ONCE])
    if report is not None:
        report(_STEPS, _STEPS)


def dance_facts(
    plan: Plan, duration_s: float, *, title: str, motion_beats_s: Sequence[float] | NDArray[np.floating]
) -> dict[str, Any]:
    """What a page shows of a plan from its start to `duration_s`, as JSON: beats, takes and blocks.

    `motion_beats_s` (Q,) are times in the dance.
    """
    return {
        "title": title,
        "duration_s": round(duration_s, 6),
        "music_beats_s": _rounded(plan.music_beats_s, duration_s),
        "music_beat_numbers": _shown_numbers(plan, duration_s),
        "metre": plan.metre,
        "motion_beats_s": _rounded(motion_beats_s, duration_s),
        **_sources(plan, duration_s),
    }


def camera_facts(camera: CameraPath) -> list[dict[str, Any]]:
    """The shots of a page's cameras, as JSON. Directions are fixed in a shot, so that targets follow."""
    return [
        {
            "name": shot.name,
            "start_s": round(shot.start_s, 4),
            "times_s": np.round(shot.times_s, 4).tolist(),
            "eyes": np.round(shot.eye_m, 3).tolist(),
            "sight": np.round(shot.target_m[0] - shot.eye_m[0], 4).tolist(),
        }
        for shot in camera.shots
    ]


def _checked_beats(motion_beats_s: Sequence[float] | NDArray[np.floating]) -> NDArray[np.float64]:
    beats_s = np.asarray(motion_beats_s, np.float64)
    if beats_s.ndim != 1 or not np.isfinite(beats_s).all() or (np.diff(beats_s) < 0).any():
        raise ParameterError("expected increasing finite motion_beats_s (Q,) in seconds")
    return beats_s


def _checked_duration(motion: Motion, plan: Plan, duration_s: float | None) -> float:
    if abs(motion.duration_s - plan.duration_s) > _LENGTH_SLACK_S:
        raise ParameterError(
            f"expected the motion of the plan, got {motion.duration_s:.2f} s of motion and a plan of "
            f"{plan.duration_s:.2f} s: are they of different dances?"
        )
    if duration_s is None:
        return min(motion.duration_s, plan.blocks[-1].end_s)
    if not (np.isfinite(duration_s) and 0 < duration_s <= motion.duration_s + _LENGTH_SLACK_S):
        raise ParameterError(
            f"expected a duration of up to {motion.duration_s:.2f} s, its length, got {duration_s:g}"
        )
    return min(duration_s, motion.duration_s)


def _sound(
    song_path: str | Path | None, start_s: float, duration_s: float, report: StepReport | None
) -> tuple[str, str, float]:
    """The sound in base64, the levels of the waveform, and their rate in Hz."""
    if song_path is None:
        return "", "", float(_LEVELS_PER_S)
    levels = Levels(_LEVELS_PER_S)
    sound = encode_mp4(levels.through(song_part(song_path, start_s=start_s, duration_s=duration_s), report))
    # The peaks come before the RMS values, because similar neighbours are compressed better.
    planes = np.ascontiguousarray(levels.to_bytes().T)
    return base64.b64encode(sound).decode("ascii"), deflate_base64(planes.tobytes()), levels.bins_per_s


def _rounded(times_s: Sequence[float] | NDArray[np.floating], duration_s: float) -> list[float]:
    return [round(float(time), 4) for time in times_s if 0 <= time <= duration_s]


def _shown_numbers(plan: Plan, duration_s: float) -> list[int]:
    """Numbers in the bar of the beats that are shown, none if bars are not known."""
    numbers = zip(plan.music_beats_s, plan.music_beat_numbers, strict=False)
    return [number for time, number in numbers if 0 <= time <= duration_s]


def _sources(plan: Plan, duration_s: float) -> dict[str, Any]:
    """The blocks of the timeline, and the table of takes that they refer to by index."""
    shown = [block for block in plan.blocks if block.start_s < duration_s]
    credits = {block.source: block.planned.credits for block in shown}
    names = sorted(credits)
    takes = [{"name": name or _NETWORK, **asdict(credits[name])} for name in names]
    index = {name: i for i, name in enumerate(names)}
    return {"takes": takes, "blocks": [_block(block, index[block.source], duration_s) for block in shown]}


def _block(block: Block, take: int, duration_s: float) -> dict[str, Any]:
    shown: dict[str, Any] = {
        "take": take,
        "start_s": round(block.start_s, 4),
        "end_s": round(min(block.end_s, duration_s), 4),
    }
    planned = block.planned
    if block.source:
        shown |= {"from_s": round(block.source_start_s, 3), "to_s": round(block.source_end_s, 3)}
        shown |= {
            "speed": round((block.source_end_s - block.source_start_s) / (block.end_s - block.start_s), 4)
        }
    if isinstance(planned, PlannedSecond):
        shown |= {"clip": planned.clip, "clip_start_s": round(planned.clip_start_s, 3)}
        return shown | {"costs": {name: round(cost, 4) for name, cost in planned.costs.items()}}
    if block.kept:
        return shown | {"kept": True, "costs": {}}
    shown |= {"mirrored": True} if planned.mirrored else {}
    return shown | {"motif": planned.motif, "pinned": planned.pinned, "costs": {}}


def _page_text(title: str, body: PageBody, dance: str, levels: str, sound: str) -> Iterator[str]:
    """Pieces of the page's template, filled."""
    elements = [f'<script type="text/plain" id="{name}">{text}</script>' for name, text in body.data.items()]
    return filled_pieces(
        page_part("index.html"),
        generator=DANCE_GENERATOR,
        title=html.escape(title),
        style=page_part("style.css"),
        dance=dance,
        sources=body.sources,
        body="\n".join(elements),
        levels=levels,
        sound=sound,
        script=bundle_scripts([page_part(name) for name in (*_SCRIPTS, *body.scripts)]),
    )
