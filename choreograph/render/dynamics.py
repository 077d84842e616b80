"""Dynamics of a dance: the size of its movements, and the poses that are held at both ends and in stops.

A dance is smaller where its song is soft, larger where it is loud, and stands still where it is silent. Real
ballroom dancers do not do this, and the papers have none of it. It is a choice of the choreographer, of the
strength `DanceConfig.dynamics`. The plan has an amplitude for each second, 1 for the size of the takes, and
the times of the stops.

A dancer who waits for the first count, or has finished, is never still. In a held pose, both feet are on the
floor, the chest rises and falls with the breath, and the weight moves slowly between the feet. The first
count is prepared: the dance is at full speed for half a second before it. The papers have no held poses.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from choreograph.core.numerics import Floats, frame_blocks
from choreograph.core.timebase import frame_times_s
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.contacts import SIDES, foot_sole_pos_m, move_leg
from choreograph.motion.kinematics import ancestors, forward, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.music.count_grids import coming_to_rest_s, setting_off_s
from choreograph.plan.runs import eased_in

_MEAN_POSE_S = 0.6  # standard deviation of the Gaussian that averages poses: about a count to each side
_KEPT_RAD = 0.8, 3.0  # excursions from the mean pose up to the first are scaled, and from the second on kept


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
    smooth: Floats = scipy.ndimage.gaussian_filter1d(
        values, _MEAN_POSE_S * fps, axis=0, mode="nearest", radius=_reach(fps)
    )
    return smooth


def _reach(fps: float) -> int:
    """How many frames to each side a mean depends on."""
    return int(4.0 * _MEAN_POSE_S * fps + 0.5)


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
    reach = _reach(fps)
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


# Held poses.


_BREATHS_HZ = 0.31, 0.42  # while waiting, and out of breath at the end
_BREATH_RAD = 0.04  # how far the chest rises
_SWAYS_HZ = 0.31, 0.43  # of the weight to the side and to the front: never at rest in both
_SWAYS_M = 0.06, 0.03
_KNEES_M = 0.012  # how far the knees give way where the weight is on one side
_ARMS_RAD = 0.04  # how far the arms give way to the breath
_LIFTED_M = 0.03  # a foot that is higher is put down
_STRETCH = 0.995  # of the leg, at most, to reach the floor
_BESIDE_FRAMES = 64  # for a spline, in which the effect of a frame falls to a quarter with every other one
_APART_M = 0.11  # ankles do not come closer to each other


def hold_ends(motion: Motion, opening_s: float, closing_s: float | None) -> Motion:
    """The motion with a pose held before the first count, and one after the last count.

    `music.count_grids` determines how the dance begins and comes to rest. With `closing_s` None it has no
    held end. Feet that are in the air in a held pose are put down on the floor, and the body breathes and
    shifts its weight.
    """
    times_s = frame_times_s(motion.n_frames, motion.fps)
    if np.array_equal(played_times_s(times_s, opening_s, closing_s), times_s):
        return motion
    held = copied(motion)
    hold_ends_in_place(held, opening_s, closing_s)
    return held


def copied(motion: Motion) -> Motion:
    """The motion with arrays of its own."""
    return replace(motion, root_pos_m=motion.root_pos_m.copy(), local_quat=motion.local_quat.copy())


@dataclass(frozen=True, eq=False)
class Replaced:
    """Frames of a motion as they were before they were changed in place."""

    first: int
    root_pos_m: Floats  # (n, 3)
    local_quat: Floats  # (n, J, 4)

    @staticmethod
    def of(motion: Motion, frames: slice) -> Replaced:
        """A copy of `frames`, of which `start` and `stop` are given."""
        return Replaced(frames.start, motion.root_pos_m[frames].copy(), motion.local_quat[frames].copy())

    def put_back(self, motion: Motion) -> None:
        """Change the frames back. The signs of later rotations may stay opposite to what they were."""
        frames = slice(self.first, self.first + len(self.root_pos_m))
        motion.root_pos_m[frames], motion.local_quat[frames] = self.root_pos_m, self.local_quat


def hold_ends_in_place(motion: Motion, opening_s: float, closing_s: float | None) -> list[Replaced]:
    """As `hold_ends`, but it changes the arrays of `motion`. Returns the frames as they were, in order."""
    times_s = frame_times_s(motion.n_frames, motion.fps)
    played_s = played_times_s(times_s, opening_s, closing_s)
    moved = np.flatnonzero(played_s != times_s)
    if len(moved) == 0:
        return []
    parts = np.split(moved, np.flatnonzero(np.diff(moved) > 1) + 1)  # one or two
    frames = [np.clip(played_s[part] * motion.fps, 0.0, motion.n_frames - 1) for part in parts]
    played = [_played(motion, of_part) for of_part in frames]
    replaced = [Replaced.of(motion, slice(int(part[0]), int(part[-1]) + 1)) for part in parts]
    for part, held in zip(parts, played, strict=True):
        motion.root_pos_m[part], motion.local_quat[part] = held.root_pos_m, held.local_quat
    rot.make_continuous(motion.local_quat, out=motion.local_quat)
    if opening_s > 0:
        from_s, to_s = setting_off_s(opening_s)
        share = 1.0 - _speed(_since(times_s, from_s, to_s))
        replaced += _hold(motion, _Held(share, 0, _BREATHS_HZ[0], from_s))
    if closing_s is not None:
        from_s, to_s = coming_to_rest_s(opening_s, closing_s)
        share = _speed(_since(times_s, from_s, to_s))
        replaced += _hold(motion, _Held(share, motion.n_frames - 1, _BREATHS_HZ[1], to_s))
    return replaced


def _played(motion: Motion, frames: Floats) -> Motion:
    """The poses at fractional `frames` (T',) by cubic splines through the frames beside them.

    A frame that is further away than these changes a spline by less than the rounding of its values.
    """
    first = max(0, int(frames.min()) - _BESIDE_FRAMES)
    part = motion.sliced(first, min(motion.n_frames, int(frames.max()) + _BESIDE_FRAMES))
    return part.sampled_smooth(frames - first)


def hold_stops_in_place(
    motion: Motion, stops_s: Sequence[tuple[float, float]], ease_s: float
) -> list[Replaced]:
    """Hold the poses in which a motion stands still, from and until times, as those at its ends.

    It slows down and sets off within `ease_s` before both times. As `hold_ends_in_place`, this changes the
    arrays of `motion`.
    """
    if not stops_s:
        return []
    times_s = frame_times_s(motion.n_frames, motion.fps)
    rot.make_continuous(motion.local_quat, out=motion.local_quat)
    replaced = []
    for rests_s, moves_s in stops_s:
        share = _speed(_since(times_s, rests_s - ease_s, rests_s))
        share *= 1.0 - _speed(_since(times_s, moves_s - ease_s, moves_s))
        frame = min(round(rests_s * motion.fps), motion.n_frames - 1)
        replaced += _hold(motion, _Held(share, frame, _BREATHS_HZ[1], rests_s))
    return replaced


def played_times_s(times_s: Floats, opening_s: float, closing_s: float | None) -> Floats:
    """The time of the dance that is played at each time (T,), which stands still while a pose is held."""
    played_s = np.array(times_s)
    if opening_s > 0:
        from_s, to_s = setting_off_s(opening_s)
        before = times_s < to_s
        eased = eased_in(_since(times_s[before], from_s, to_s))
        played_s[before] = to_s - (to_s - from_s) * (0.5 - eased)
    if closing_s is not None:
        from_s, to_s = coming_to_rest_s(opening_s, closing_s)
        after = times_s > from_s
        since = _since(times_s[after], from_s, to_s)
        played_s[after] = from_s + (to_s - from_s) * (since - eased_in(since))
    return played_s


def _since(times_s: Floats, from_s: float, to_s: float) -> Floats:
    """How much of a span has passed at each time, 0 to 1."""
    return np.clip((times_s - from_s) / (to_s - from_s), 0.0, 1.0)


def _speed(since: Floats) -> Floats:
    """The speed of `eased_in`, 0 to 1."""
    return since * since * (3.0 - 2.0 * since)


@dataclass(frozen=True, eq=False)
class _Held:
    """A pose that is held."""

    share: Floats  # (T,) 1 where it is held, 0 where the dance is at full speed
    frame: int  # at which it is held
    breath_hz: float
    from_s: float  # at which the movement of breath and weight passes through zero


def _hold(motion: Motion, pose: _Held) -> list[Replaced]:
    """Change roots and rotations of a motion to a pose that is held. Returns the frames as they were.

    It stands on both feet, breathes and shifts its weight. The signs of rotations remain continuous.
    """
    held = np.flatnonzero(pose.share > 0)
    if len(held) == 0:
        return []
    part = slice(int(held[0]), int(held[-1]) + 1)
    roots, quats, replaced = motion.root_pos_m, motion.local_quat, Replaced.of(motion, part)
    share, frame = pose.share[part, None], pose.frame - part.start
    phase_s = frame_times_s(motion.n_frames, motion.fps)[part] - pose.from_s
    skeleton, roles = motion.skeleton, joint_roles(motion.skeleton)
    root_pos_m, local_quat = roots[part].copy(), quats[part].copy()
    pos_m, before_quat = forward(skeleton, root_pos_m, local_quat)
    steps = {side: _step_down(skeleton, roles, side, pos_m[frame], before_quat[frame]) for side in SIDES}
    root_pos_m += share * _sway_m(pos_m[frame], roles, phase_s)
    _breathe(local_quat, roles, share[:, 0], phase_s, pose.breath_hz)
    moved_m, global_quat = forward(skeleton, root_pos_m, local_quat)
    for side in SIDES:
        ankle, step = roles[f"{side}_ankle"], steps[side]
        foot = [joint for joint in range(skeleton.n_joints) if ankle in ancestors(skeleton, joint)]
        for joint in foot:  # the foot stays, or is laid flat on the floor
            flat = rot.multiply(step.turn, before_quat[:, joint])
            global_quat[:, joint] = rot.slerp(before_quat[:, joint], flat, share[:, 0])
        move_leg(skeleton, roles, side, moved_m, global_quat, pos_m[:, ankle] + share * step.shift_m)
    for block in frame_blocks(len(global_quat)):
        global_quat[block] = to_local(skeleton, global_quat[block])
    roots[part], quats[part] = root_pos_m, global_quat
    near = quats[max(part.start - 1, 0) : part.stop]
    rot.make_continuous(near, out=near)
    if part.stop < len(quats):
        flipped = np.sum(near[-1] * quats[part.stop], axis=-1) < 0  # (J,)
        if flipped.any():
            quats[part.stop :] *= np.where(flipped, -1.0, 1.0)[:, None]
    return [replaced]


def _sway_m(pose_m: Floats, roles: dict[str, int], phase_s: Floats) -> Floats:
    """How far the body is from the pose (J, 3), (T, 3): to the side, to the front, and lower at the sides."""
    aside = (pose_m[roles["left_hip"]] - pose_m[roles["right_hip"]]) * [1.0, 0.0, 1.0]
    aside /= max(float(np.linalg.norm(aside)), 1e-6)
    ahead = np.array([-aside[2], 0.0, aside[0]])
    side_m, front_m = (
        size_m * np.sin(2 * np.pi * hz * phase_s) for size_m, hz in zip(_SWAYS_M, _SWAYS_HZ, strict=True)
    )
    sway_m: Floats = side_m[:, None] * aside + front_m[:, None] * ahead
    sway_m[:, 1] -= _KNEES_M * (side_m / _SWAYS_M[0]) ** 2
    return sway_m


def _breathe(
    local_quat: Floats, roles: dict[str, int], share: Floats, phase_s: Floats, breath_hz: float
) -> None:
    """Let the chest of local rotations (T, J, 4) rise and fall. The head stays upright, the arms give way."""
    breath = share * np.sin(2 * np.pi * breath_hz * phase_s)  # (T,)
    turns = {
        "spine3": [-_BREATH_RAD, 0.0, 0.0],
        "neck": [0.7 * _BREATH_RAD, 0.0, 0.0],
        "left_shoulder": [0.0, 0.0, _ARMS_RAD],
        "right_shoulder": [0.0, 0.0, -_ARMS_RAD],
    }
    for name, turn in turns.items():
        if name in roles:
            joint = roles[name]
            local_quat[:, joint] = rot.multiply(
                local_quat[:, joint], rot.from_rotvec(breath[:, None] * np.array(turn))
            )


@dataclass(frozen=True, eq=False)
class _Step:
    """How a foot of a held pose is put down: nothing for one that stands."""

    shift_m: Floats  # (3,) of the ankle
    turn: Floats  # (4,) of the foot


_STANDS = _Step(np.zeros(3), rot.IDENTITY)


def _step_down(
    skeleton: Skeleton, roles: dict[str, int], side: str, pose_m: Floats, global_quat: Floats
) -> _Step:
    """How a foot of a pose, (J, 3) and (J, 4), gets to the floor: down, and in as far as the leg requires."""
    sole_m = foot_sole_pos_m(skeleton, pose_m[None], global_quat[None], side)[0]
    if sole_m[:, 1].min() <= _LIFTED_M:
        return _STANDS
    hip, knee, ankle = (roles[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
    other = pose_m[roles[f"{'right' if side == 'left' else 'left'}_ankle"]]
    turn = rot.multiply(rot.about_y(rot.yaw(global_quat[ankle])), rot.invert(global_quat[ankle]))
    flat_m = pose_m[ankle] + rot.rotate(turn, sole_m - pose_m[ankle])
    target = pose_m[ankle] * [1.0, 0.0, 1.0]
    target[1] = pose_m[ankle][1] - flat_m[:, 1].min()  # the ankle over a sole on the floor
    leg_m = sum(float(np.linalg.norm(pose_m[a] - pose_m[b])) for a, b in ((hip, knee), (knee, ankle)))
    reach_m = np.sqrt(max((_STRETCH * leg_m) ** 2 - (pose_m[hip][1] - target[1]) ** 2, 1e-4))
    target[[0, 2]] = _within(target[[0, 2]], pose_m[hip][[0, 2]], reach_m)
    apart = target[[0, 2]] - other[[0, 2]]
    if np.linalg.norm(apart) < _APART_M:  # beside the standing foot, on its own side
        aside = (pose_m[hip] - pose_m[roles["pelvis"]])[[0, 2]]
        target[[0, 2]] = other[[0, 2]] + _APART_M * aside / max(float(np.linalg.norm(aside)), 1e-6)
    return _Step(target - pose_m[ankle], turn)


def _within(place: Floats, middle: Floats, radius_m: float) -> Floats:
    """A place on the floor (2,), moved towards `middle` (2,) to at most `radius_m` from it."""
    away = place - middle
    return middle + away * min(1.0, radius_m / max(float(np.linalg.norm(away)), 1e-9))
