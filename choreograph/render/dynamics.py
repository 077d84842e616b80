"""Dynamics: a dance is smaller where its song is soft, larger where it is loud, and stops where it is silent.

Real ballroom dancers do not do this, and the papers have none of it. It is a choice of the choreographer, of
the strength `DanceConfig.dynamics`. The size is planned for each second as an amplitude, 1 for the size of
the takes. In a stop, a pose is held in the way of the poses at both ends of a dance.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from choreograph.core.filters import gaussian_filter, reach_of
from choreograph.core.numerics import AnyFloats, Floats, frame_blocks
from choreograph.core.timebase import NET_FPS, frame_times_s
from choreograph.motion import rotations as rot
from choreograph.motion.foot_locking import SIDES, move_leg
from choreograph.motion.kinematics import ancestors, forward, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles
from choreograph.render.held_poses import copied, eased_in
from choreograph.render.runs import Run

LEAST_AMPLITUDE, GREATEST_AMPLITUDE = 0.5, 1.1
_GAIN = 0.85  # of the amplitude, for the difference of the energy from the song's usual one
_ACCENT = 0.5  # of a rise of the energy within 2 s, added to the energy of its first seconds
_MEAN_POSE_S = 0.6  # standard deviation of the Gaussian that averages poses: about a count to each side
_USUAL_PERCENTILE = 75  # of the energy, at which a dance has the size of the takes
_NEARLY_USUAL = 0.1  # of the energy. A rise to a softer second is no accent
_STEP = 0.05  # of amplitudes, so that a song of one loudness has none
_KEPT_RAD = 0.8, 3.0  # excursions from the mean pose up to the first are scaled, and from the second on kept


def amplitudes(energy: AnyFloats, strength: float, fixed: Collection[int] = ()) -> tuple[float, ...]:
    """The amplitude of each second (S,) of a dance by the energy of its song (S,), none if all are 1.

    It is 1 at the energy that a quarter of the song exceeds. A sudden rise is an accent of two seconds. The
    `strength` is 1 for the full range, 0.5 to 1.1, and 0 for none. `fixed` seconds have the amplitude 1.
    """
    known = np.asarray(energy, np.float64)
    before = np.concatenate([known[:1], known[:1], known])[: len(known)]  # 2 s ago
    louder = known - np.percentile(known, _USUAL_PERCENTILE)
    louder += _ACCENT * np.maximum(known - before, 0.0) * (louder > -_NEARLY_USUAL)
    full = np.clip(1.0 + _GAIN * louder, LEAST_AMPLITUDE, GREATEST_AMPLITUDE)
    scaled = np.round(np.round((1.0 + strength * (full - 1.0)) / _STEP) * _STEP, 2)
    scaled[[second for second in fixed if second < len(scaled)]] = 1.0
    return tuple(scaled.tolist()) if (scaled != 1.0).any() else ()


def with_amplitudes(motion: Motion, amplitudes: Sequence[float]) -> Motion:
    """The motion with its size scaled by the amplitude of each second (S,), smoothly in time.

    The pelvis travels by a share of its way, and every joint turns by a share of its excursion from the mean
    pose of about two counts. The feet step in proportion, so that a foot that stands remains in place, as
    far as the mean pose does not change. Lock the feet afterwards. Turns of the body are kept.
    """
    if not amplitudes:
        return motion
    scaled = copied(motion)
    scale_in_place(scaled, amplitudes)
    return scaled


def scale_in_place(motion: Motion, amplitudes: Sequence[float]) -> None:
    """As `with_amplitudes`, but it changes the arrays of `motion`."""
    scale = _scale(amplitudes, motion.n_frames, motion.fps)
    skeleton, roles = motion.skeleton, joint_roles(motion.skeleton)
    feet = {
        side: [j for j in range(skeleton.n_joints) if roles[f"{side}_ankle"] in ancestors(skeleton, j)]
        for side in SIDES
    }
    blocks = list(frame_blocks(motion.n_frames))  # all joints of a long dance are large
    ankles = [roles[f"{side}_ankle"] for side in SIDES]
    parts_m = [forward(skeleton, motion.root_pos_m[b], motion.local_quat[b])[0][:, ankles] for b in blocks]
    ankle_m = np.concatenate(parts_m)  # (T, 2, 3)
    root_pos_m = _scaled_path(motion.root_pos_m, scale, motion.fps)
    local_quat = rot.make_continuous(motion.local_quat, out=motion.local_quat)
    away_m = ankle_m - motion.root_pos_m[:, None]
    mean_m = _smooth(away_m, motion.fps)
    target_m = root_pos_m[:, None] + mean_m + scale[:, None] * (away_m - mean_m)
    target_m[..., 1] = ankle_m[..., 1]  # a lower foot would slide on the floor
    for block, turns in zip(blocks, _scaled_turns(local_quat, scale, motion.fps), strict=True):
        _, before_quat = forward(skeleton, motion.root_pos_m[block], local_quat[block])
        moved_m, global_quat = forward(skeleton, root_pos_m[block], turns)
        for index, side in enumerate(SIDES):
            global_quat[:, feet[side]] = before_quat[:, feet[side]]  # the foot keeps its rotation
            move_leg(skeleton, roles, side, moved_m, global_quat, target_m[block, index])
        local_quat[block] = to_local(skeleton, global_quat)
    rot.make_continuous(local_quat, out=local_quat)
    motion.root_pos_m[:] = root_pos_m


def scaled_root(root_pos_m: Floats, amplitudes: Sequence[float], fps: float) -> Floats:
    """The root (T, 3) that a motion with this root has with amplitudes, before poses are held."""
    return (
        _scaled_path(root_pos_m, _scale(amplitudes, len(root_pos_m), fps), fps) if amplitudes else root_pos_m
    )


def _scale(amplitudes: Sequence[float], n_frames: int, fps: float) -> Floats:
    """The amplitude of each frame (T, 1)."""
    knots_s = np.arange(len(amplitudes)) + 0.5
    return _smooth(np.interp(frame_times_s(n_frames, fps), knots_s, amplitudes), fps)[:, None]


def _smooth(values: Floats, fps: float) -> Floats:
    """Values (T, ...) averaged in time."""
    return gaussian_filter(values, _MEAN_POSE_S * fps)


def _scaled_path(root_pos_m: Floats, scale: Floats, fps: float) -> Floats:
    """The root (T, 3) at `scale` (T, 1) times its speed on the ground, and its excursion in height."""
    steps_m = 0.5 * (scale[1:] + scale[:-1]) * np.diff(root_pos_m, axis=0)
    path_m: Floats = root_pos_m[:1] + np.concatenate([np.zeros((1, 3)), np.cumsum(steps_m, axis=0)])
    mean_m = _smooth(root_pos_m[:, 1], fps)
    path_m[:, 1] = mean_m + scale[:, 0] * (root_pos_m[:, 1] - mean_m)
    return path_m


def _scaled_turns(local_quat: Floats, scale: Floats, fps: float) -> Iterator[Floats]:
    """Blocks of rotations (T, J, 4) with `scale` (T, 1) times their excursion from the mean.

    A large excursion is kept, because the other way round would be as far. The rows of a block may be
    changed before the next block is taken: what its means need of them is copied before.
    """
    reach = reach_of(_MEAN_POSE_S * fps)
    before = local_quat[:0]  # unchanged frames before the block
    for block in frame_blocks(len(local_quat)):
        rows = local_quat[block]
        near = np.concatenate([before, local_quat[block.start : block.stop + reach]])
        means = _smooth(near, fps)[len(before) : len(before) + len(rows)]
        before = near[max(0, len(before) + len(rows) - reach) : len(before) + len(rows)]
        mean_quat = rot.normalize(means)
        excursion = rot.to_rotvec(rot.multiply(rot.invert(mean_quat), rows))  # (T_b, J, 3)
        size_rad = np.linalg.norm(excursion, axis=-1)
        kept = np.clip((size_rad - _KEPT_RAD[0]) / (_KEPT_RAD[1] - _KEPT_RAD[0]), 0.0, 1.0)
        of_joint = 1.0 + (scale[block] - 1.0) * (1.0 - kept * kept * (3.0 - 2.0 * kept))  # (T_b, J)
        yield rot.multiply(mean_quat, rot.from_rotvec(of_joint[..., None] * excursion))


# Stops: the dance stands still where its song is silent.


STOP_EASE_S = 0.35  # in which a dance comes to rest, and in which it sets off


def with_stops(runs: Sequence[Run], stops_s: Sequence[tuple[float, float]]) -> list[Run]:
    """The runs of a dance, which stands still from and until the times of each stop.

    The run that is danced into a stop comes to rest, and continues after it from the pose in which it rests,
    as much later as the stop is long. Its counts remain on the counts of the song, because a stop lasts whole
    bars. If another run would begin during the stop, that run follows instead, when the dance sets off.
    Stops in a locked run are left out.
    """
    stopped = list(runs)
    for stop_s in stops_s:
        stopped = _with_stop(stopped, *stop_s)
    return stopped


def _with_stop(runs: list[Run], rests_s: float, moves_s: float) -> list[Run]:
    sets_off_s = moves_s - STOP_EASE_S
    before = next((run for run in runs if run.start_s < rests_s <= run.stop_s), None)
    after = next((run for run in runs if run.start_s <= sets_off_s < run.stop_s), None)
    if before is None or after is None or before.locked or after.locked:
        return runs
    if before is after:
        stopped = [_played(before, before.start_s, before.stop_s, rests_s, moves_s, moves_s - rests_s)]
    else:
        coming = _played(before, before.start_s, sets_off_s, rests_s, np.inf)
        going = _played(after, sets_off_s, after.stop_s, -np.inf, moves_s)
        stopped = [coming, replace(going, transition_s=STOP_EASE_S)]
    return [
        *(run for run in runs if run.start_s < before.start_s),
        *stopped,
        *(run for run in runs if run.start_s > after.start_s),
    ]


def _played(
    run: Run, start_s: float, stop_s: float, rests_s: float, moves_s: float, later_s: float = 0.0
) -> Run:
    """The run from a start to a stop, at rest from and until two times, and then `later_s` later."""
    times_s = np.linspace(start_s, stop_s, max(2, round((stop_s - start_s) * NET_FPS)) + 1)
    sets_off_s = moves_s - STOP_EASE_S
    slowing = np.clip((times_s - rests_s) / STOP_EASE_S + 1.0, 0.0, 1.0)
    speeding = np.clip((times_s - sets_off_s) / STOP_EASE_S, 0.0, 1.0)
    coming_s = np.minimum(times_s, rests_s - STOP_EASE_S) + STOP_EASE_S * (slowing - eased_in(slowing))
    going_s = np.maximum(times_s, moves_s) - later_s - STOP_EASE_S * (0.5 - eased_in(speeding))
    played_s = np.where(times_s < sets_off_s, coming_s, going_s)
    return replace(run, start_s=start_s, stop_s=stop_s, source_times_s=run.source_s(played_s))
