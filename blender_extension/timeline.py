# SPDX-License-Identifier: GPL-3.0-or-later
"""The song, markers, frame range and credits of a dance in a scene.

The next dance replaces them. Strips and actions of a dance have the property `OURS`, and its markers are
listed in the settings of the scene.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from .program import Dance, Request

OURS = "choreograph"


def lay_out(scene: bpy.types.Scene, request: Request, dance: Dance, first_frame: int) -> None:
    """Set the frame range, and put the song and the markers on the timeline."""
    last_frame = first_frame + dance.tracks.n_frames - 1
    scene.frame_start, scene.frame_end = first_frame, last_frame
    if scene.sync_mode == "NONE":
        scene.sync_mode = "AUDIO_SYNC"  # otherwise slow playback loses the beat
    _place_song(scene, request, first_frame, last_frame)
    _place_markers(scene, request, dance, first_frame)


def _place_song(scene: bpy.types.Scene, request: Request, first_frame: int, last_frame: int) -> None:
    strips = scene.sequence_editor_create().strips
    for strip in [strip for strip in strips if OURS in strip]:
        sound = strip.sound
        strips.remove(strip)
        if sound and not sound.users:
            bpy.data.sounds.remove(sound)
    channel = 1 + max((strip.channel for strip in strips), default=0)
    before = round(request.start_s * request.fps)
    strip = strips.new_sound(request.song.stem, str(request.song), channel, first_frame - before)
    strip[OURS] = True
    strip.frame_offset_start = before
    strip.frame_final_end = min(strip.frame_final_end, last_frame + 1)


def _place_markers(scene: bpy.types.Scene, request: Request, dance: Dance, first_frame: int) -> None:
    placed, markers = scene.choreograph.markers, scene.timeline_markers
    for mark in placed:
        found = next((each for each in markers if (each.name, each.frame) == (mark.name, mark.frame)), None)
        if found:
            markers.remove(found)
    placed.clear()
    labels: dict[int, list[str]] = {}
    for at_s, label in (*_bars(dance), *_takes(dance)):
        labels.setdefault(first_frame + round(at_s * request.fps), []).append(label)
    for frame, of_frame in sorted(labels.items()):
        mark = placed.add()
        mark.name, mark.frame = ", ".join(of_frame), frame
        markers.new(mark.name, frame=frame)


def _bars(dance: Dance) -> Iterator[tuple[float, str]]:
    """Start and label of each bar of the dance."""
    beats = zip(dance.plan["music_beats_s"], dance.plan["music_beat_numbers"], strict=False)
    for bar, at_s in enumerate((at_s for at_s, number in beats if number == 1), start=1):
        yield at_s, f"bar {bar}"


def _takes(dance: Dance) -> Iterator[tuple[float, str]]:
    """Start and name of each change of take in the dance."""
    dancing = ""
    for block in dance.facts["blocks"]:
        if block["source"] != dancing:
            dancing = block["source"]
            yield block["start_s"], dancing


def write_credits(name: str, dance: Dance) -> bpy.types.Text:
    """A text block with the credits of the takes, and the notes of the program."""
    facts = dance.facts
    lines = [f"{facts['song']}, danced with {facts['repertoire']}", ""]
    for take in facts["takes"]:
        lines.append(f"{take['name'] or 'generated motion'}, {take['seconds']:.1f} s")
        lines += [
            f"    {key}: {take[key]}" for key in ("genre", "performer", "licence", "source") if take[key]
        ]
    lines += ["", *facts["notes"]]
    text = bpy.data.texts.new(name)
    text.write("\n".join(lines).rstrip() + "\n")
    return text


def leave(action: bpy.types.Action) -> None:
    """Keep an action of the user in the file. Remove an unused action of a dance, and its credits."""
    if OURS not in action:
        action.use_fake_user = True
    if action.users:
        return
    text = action[OURS]
    bpy.data.actions.remove(action)
    if text is not None and text.users <= text.use_fake_user:
        bpy.data.texts.remove(text)
