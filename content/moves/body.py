"""Renders keyframes to motion: pelvis over the feet, legs by inverse kinematics, spine, head and arms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import solveh_banded
from scipy.ndimage import gaussian_filter1d

from choreograph.core.numerics import Floats
from choreograph.core.timebase import frame_times_s
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import two_bone
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton
from content.moves.arm_poses import shoulder_quat
from content.moves.carriage import Carriage, carry, support_of
from content.moves.clearance import clear_trunk
from content.moves.curves import Tempo, ease, evaluate, smooth_noise, spring_follow, spring_lag_s
from content.moves.feet import FootPath, foot_path
from content.moves.keyframes import MoveKeyframes
from content.moves.notation import ARM_CHANNELS, CHANNELS, SIDES, Side

_SKELETON = canonical_skeleton()
_INDEX = {name: i for i, name in enumerate(_SKELETON.names)}
_LEG_M = float(sum(np.linalg.norm(_SKELETON.offsets_m[_INDEX[j]]) for j in ("left_knee", "left_ankle")))
_REACH = 0.9965  # of a leg's length: nearer to straight, a leg does not quite reach its foot
_STANDING_M = float(_SKELETON.offsets_m[0][1])  # pelvis over the floor on straight legs
_GLIDE_S = 0.03  # smooths the path of the weight
_PUSH_M_S2 = 14.0  # the pelvis is caught and pushed up by at most this
_CATCH_S = 0.35  # before and after a deep point
_SOFTLY_S = 0.025  # smooths the path of the pelvis
_KNEE_S = 0.04  # over about this time, the knee of a leg in the air changes its speed
_OUT_OF_REACH = 0.999  # of a leg's length
_HEEL_RAD, _HEEL_S = np.radians(np.arange(0.0, 21.0, 2.5)), 0.05
_FLAT_RAD = 1e-3  # a foot that turns less is flat
_FLAT_S = 0.3  # after a foot has landed
_HEEL_DOWN_S = 0.2  # after a foot has left
_BENT_RAD = 0.07  # of thigh and shin, from which a leg is bent or stretched
_BODY_HZ, _ARM_HZ, _DAMPING = 5.0, 4.0, 0.72  # springs of the follow-through of spine and arms
# Joint, share of bend, side and twist, share of the arch (lower spine forward, upper back), lag in s.
_SPINE = (("spine1", 0.38, -0.36, -0.015), ("spine2", 0.34, 0.06, 0.0), ("spine3", 0.28, 0.6, 0.02))


def animate(
    keys: MoveKeyframes,
    tempo: Tempo,
    duration_s: float,
    fps: float,
    rng: np.random.Generator | None,
    carriage: Carriage,
) -> tuple[Motion, dict[Side, FootPath]]:
    """The motion of keyframes over `duration_s` from the song's start, and the paths of its feet.

    With `rng`, idle motion (breath, looks, hands) is added.
    """
    times = frame_times_s(max(2, round(duration_s * fps)), fps)  # (T,)
    feet = {side: foot_path(keys.plants[side], tempo, times) for side in SIDES}
    ch = _channels(keys, tempo, times, fps, rng)
    facing = evaluate(keys.facing, tempo.counts(times))[:, 0]
    spot = evaluate(keys.ground, tempo.counts(times - _LAG_S["ground"]))  # (T, 2)
    spot = gaussian_filter1d(spot, _GLIDE_S * fps, axis=0, mode="nearest")
    load = evaluate(keys.load, tempo.counts(times))[:, 0]
    balls_m = np.stack([feet[side].ball_m for side in SIDES])
    carry(ch, support_of(load, balls_m, spot, facing, fps), carriage, tempo.counts(times), fps, rng)
    root_quat = _pelvis_quat(facing, ch)
    root = _pelvis_pos(spot, feet, facing, root_quat, load, ch, carriage, fps)
    local = np.tile(rot.IDENTITY, (len(times), _SKELETON.n_joints, 1))  # (T, J, 4)
    local[:, 0] = root_quat
    _spine_and_head(local, ch, fps)
    _arms(local, ch, carriage.arms_open, fps)
    clear_trunk(local, root, fps)
    for side in SIDES:
        hip_pos = root + rot.rotate(root_quat, _SKELETON.offsets_m[_INDEX[f"{side}_hip"]])
        feet[side] = _softly_bent(feet[side], hip_pos, fps)
        _leg(local, hip_pos, side, feet[side])
    return Motion(_SKELETON, root, rot.make_continuous(local), fps), feet


def _channels(
    keys: MoveKeyframes, tempo: Tempo, times: Floats, fps: float, rng: np.random.Generator | None
) -> dict[str, Floats]:
    """All channels (T,) in metres and radians, arms (T, 6), with follow-through and idle motion."""
    ch: dict[str, Floats] = {}
    for name in CHANNELS:
        unit = 1.0 if name in ("hip_side", "hip_fwd", "drop") else np.pi / 180.0
        ahead = times + spring_lag_s(_BODY_HZ, _DAMPING) - _LAG_S.get(name.partition("_")[0], 0.0)
        track = unit * evaluate(keys.channels[name], tempo.counts(ahead))
        ch[name] = spring_follow(track, fps, frequency_hz=_BODY_HZ, damping=_DAMPING)[:, 0]
    for name in ARM_CHANNELS:
        ahead = times + spring_lag_s(_ARM_HZ, _DAMPING) - _LAG_S["arm"]
        track = evaluate(keys.channels[name], tempo.counts(ahead))
        ch[name] = spring_follow(track, fps, frequency_hz=_ARM_HZ, damping=_DAMPING)
    ch["bob"] = evaluate(keys.bob, tempo.counts(times))[:, 0]
    if rng is not None:
        _add_idle_motion(ch, times, rng)
    return ch


# Lag after the count in seconds, negative for what leads. Elbow and hand lag further.
_LAG_S = {
    "ground": -0.02,
    "hip": -0.03,
    "drop": -0.02,
    "bend": -0.01,
    "nod": 0.02,
    "look": 0.03,
    "tilt": 0.02,
    "arm": 0.0,
}

# Standard deviations of the idle motion, metres and radians.
_IDLE_AMOUNT = {"hip_side": 0.004, "hip_fwd": 0.005, "twist": 0.018, "bend": 0.014, "side": 0.010}


def _add_idle_motion(ch: dict[str, Floats], times: Floats, rng: np.random.Generator) -> None:
    """Add sway and breath."""
    breath = np.sin(2 * np.pi * times / 3.7 + rng.uniform(0.0, 2 * np.pi))
    for name, amount in _IDLE_AMOUNT.items():
        ch[name] = ch[name] + amount * smooth_noise(times, rng, slow_s=9.0, fast_s=2.2)
    for name, amount in (("arch", 0.012), ("left_shrug", 0.015), ("right_shrug", 0.015)):
        ch[name] = ch[name] + amount * breath


def _euler(x: Floats, y: Floats, z: Floats) -> Floats:
    """Intrinsic rotations about Y, Z, X: twist, lean, bend."""
    return rot.from_euler("YZX", np.stack([y, z, x], axis=-1))


def _pelvis_quat(facing: Floats, ch: dict[str, Floats]) -> Floats:
    return _euler(ch["hip_tilt"], facing + ch["hip_turn"], ch["hip_roll"])


def _pelvis_pos(
    spot: Floats, feet: dict[Side, FootPath], facing: Floats, root_quat: Floats, load: Floats,
    ch: dict[str, Floats], carriage: Carriage, fps: float,
) -> Floats:  # fmt: skip
    """(T, 3): over the feet by their share of the weight, as high as bounce, pliés and leg reach allow.

    The heel of a foot that the weight leaves is raised in `feet` before the pelvis sinks.
    """
    sway = np.stack([ch["hip_side"], np.zeros_like(facing), ch["hip_fwd"]], axis=-1)
    pos = rot.rotate(rot.about_y(facing), sway)
    pos[:, [0, 2]] += spot
    pos[:, 1] = 0.0
    wanted = _STANDING_M - carriage.stoop_m - ch["bob"] - ch["drop"]
    highest = [_highest(pos, root_quat, side, feet[side], carriage.reach) for side in SIDES]
    for side, carried, of_other in zip(SIDES, (load, 1.0 - load), highest[::-1], strict=True):
        over = pos + np.array([0.0, 1.0, 0.0]) * np.minimum(wanted, of_other)[:, None]
        feet[side] = _heel_raised(over, root_quat, side, feet[side], carried, carriage.reach, fps)
    limit = np.min(
        [_highest(pos, root_quat, side, feet[side], min(carriage.reach, _REACH)) for side in SIDES], axis=0
    )
    at_most = np.min([_highest(pos, root_quat, side, feet[side], _REACH) for side in SIDES], axis=0)
    pos[:, 1] = np.minimum(_soft_min(wanted, _caught(limit, fps)), at_most) - ch["sinks"]
    return pos


def _caught(limit: Floats, fps: float) -> Floats:
    """A height (T,) below `limit` that is caught before a deep point and pushed up after it.

    It accelerates upwards by at most `_PUSH_M_S2`: the lowest of the parabolas that stand on the limit.
    """
    frames = round(_CATCH_S * fps)
    padded = np.pad(limit, frames, mode="edge")
    apart_s = np.arange(-frames, frames + 1) / fps
    height = np.min(sliding_window_view(padded, 2 * frames + 1) + 0.5 * _PUSH_M_S2 * apart_s**2, axis=-1)
    return gaussian_filter1d(height, _SOFTLY_S * fps)


def _heel_raised(
    wanted: Floats, root_quat: Floats, side: str, foot: FootPath, carried: Floats, reach: float, fps: float
) -> FootPath:
    """The foot on its ball as far as a pelvis at `wanted` (T, 3) needs, while it carries less."""
    needed = np.zeros(len(carried))
    for pitch in _HEEL_RAD:
        tried = replace(foot, pitch_rad=np.maximum(foot.pitch_rad, pitch))
        needed[_highest(wanted, root_quat, side, tried, reach) < wanted[:, 1]] = pitch
    needed *= np.clip((0.6 - carried) / 0.3, 0.0, 1.0)
    frames = np.arange(len(needed))
    landed = np.maximum.accumulate(np.where(foot.planted, -10 * len(frames), frames))
    needed *= ease((frames - landed) / (_FLAT_S * fps))
    last = np.maximum.accumulate(np.where(foot.planted, frames, 0))  # in the air, as it left
    needed = needed[last] * (1.0 - ease((frames - last) / (_HEEL_DOWN_S * fps)))
    needed = gaussian_filter1d(needed, _HEEL_S * fps, mode="nearest")
    needed[needed < _FLAT_RAD] = 0.0
    pitch = np.where(needed > foot.pitch_rad, needed, foot.pitch_rad)
    return replace(foot, pitch_rad=pitch, flat=foot.flat & (needed < 1e-9))


def _highest(pos: Floats, root_quat: Floats, side: str, foot: FootPath, reach: float) -> Floats:
    """The greatest height (T,) of the pelvis at which this leg reaches its ankle."""
    hip = rot.rotate(root_quat, _SKELETON.offsets_m[_INDEX[f"{side}_hip"]])
    gap = foot.ankle_m() - pos - hip
    level = np.maximum((reach * _LEG_M) ** 2 - gap[:, 0] ** 2 - gap[:, 2] ** 2, 0.25**2)
    return gap[:, 1] + np.sqrt(level)


def _soft_min(a: Floats, b: Floats, width: float = 0.005) -> Floats:
    return 0.5 * (a + b - np.sqrt((a - b) ** 2 + width**2))


def _spine_and_head(local: Floats, ch: dict[str, Floats], fps: float) -> None:
    """Spine, neck and head: the chest compensates for the hips, the head for the chest."""
    side = -ch["side"] - 0.85 * ch["hip_roll"]  # about +Z, where left is negative
    twist = ch["twist"] - 0.9 * ch["hip_turn"]
    bend = ch["bend"] - 0.85 * ch["hip_tilt"]
    for name, share, arch, lag_s in _SPINE:
        x, y, z = share * bend - arch * ch["arch"], share * twist, share * side
        local[:, _INDEX[name]] = _euler(*(_delayed(angle, lag_s * fps) for angle in (x, y, z)))
    nod = ch["nod"] - 0.45 * (ch["bend"]) + 0.25 * ch["arch"]
    look, tilt = ch["look"] - 0.5 * ch["twist"], -ch["tilt"] + 0.55 * ch["side"]
    for name, share in (("neck", 0.45), ("head", 0.55)):
        local[:, _INDEX[name]] = _euler(share * nod, share * look, share * tilt)
    for name, sign in zip(SIDES, (1.0, -1.0), strict=True):
        collar = np.stack(
            [np.zeros_like(nod), -sign * ch[f"{name}_reach"], sign * ch[f"{name}_shrug"]], axis=-1
        )
        local[:, _INDEX[f"{name}_collar"]] = rot.from_rotvec(collar)


def _arms(local: Floats, ch: dict[str, Floats], open_deg: float, fps: float) -> None:
    """Shoulders, elbows and wrists from `Arm.coordinates`. Elbow and hand lag, wrists drag behind."""
    for side in SIDES:
        a = ch[f"{side}_arm"]  # (T, 6)
        elbow = _delayed(a[:, 3], 0.03 * fps)
        speed = np.gradient(elbow) * fps
        give = gaussian_filter1d(np.clip(0.05 * speed, -0.45, 0.45), 0.04 * fps, mode="nearest")
        wrist, palm = (
            _delayed(a[:, 4], 0.07 * fps) - _delayed(give, 0.03 * fps),
            _delayed(a[:, 5], 0.05 * fps),
        )
        zero = np.zeros_like(wrist)
        turns = {
            "shoulder": rot.multiply(rot.about_y(np.radians(open_deg)), shoulder_quat(a[:, :3])),
            "elbow": rot.multiply(_about(zero, -elbow, zero), _about(-0.5 * palm, zero, zero)),
            "wrist": rot.multiply(_about(-0.5 * palm, zero, zero), _about(zero, zero, -wrist)),
            "hand": _about(zero, zero, -0.3 * wrist - 0.12),
        }
        mirror = np.array([1.0, 1.0, -1.0, -1.0] if side == "right" else [1.0] * 4)
        for joint, quat in turns.items():
            local[:, _INDEX[f"{side}_{joint}"]] = quat * mirror


def _about(x: Floats, y: Floats, z: Floats) -> Floats:
    return rot.from_rotvec(np.stack([x, y, z], axis=-1))


def _delayed(values: Floats, frames: float) -> Floats:
    at = np.arange(len(values), dtype=np.float64)
    return np.interp(at - frames, at, values)


def _softly_bent(foot: FootPath, hip_pos: Floats, fps: float) -> FootPath:
    """The path of a foot that moves nearer to the hip (T, 3) or farther, so that its knee has no jerk.

    A straight leg bends by 40 degrees as its foot comes nearer by a tenth. A foot on the floor does not move,
    and none goes below it.
    """
    thigh, shin = (float(np.linalg.norm(_SKELETON.offsets_m[_INDEX[f"left_{j}"]])) for j in ("knee", "ankle"))
    gap = foot.ankle_m() - hip_pos
    apart = np.linalg.norm(gap, axis=-1)  # (T,)
    cos = (apart**2 - thigh**2 - shin**2) / (2.0 * thigh * shin)
    room = foot.over_floor_m()
    still = foot.planted | ((foot.pitch_rad < 0.0) & (room < 1e-3))
    bent = _smoothed(np.arccos(np.clip(cos, -1.0, 1.0)), np.where(still, 1e4, 1.0), (_KNEE_S * fps) ** 4)
    wanted = np.sqrt(thigh**2 + shin**2 + 2.0 * thigh * shin * np.cos(np.clip(bent, 0.0, 2.6)))
    down = np.maximum(-gap[:, 1] / apart, 0.2)
    wanted = np.minimum(wanted, apart + np.maximum(room, 0.0) / down)
    fixed = still | (apart > _OUT_OF_REACH * _LEG_M)
    nearer = np.where(fixed, 0.0, wanted / apart - 1.0)
    return replace(foot, ball_m=foot.ball_m + nearer[:, None] * gap)


def _smoothed(values: Floats, weights: Floats, stiffness: float) -> Floats:
    """The values (T,) that have the least weighted squared errors and `stiffness` times squared bends."""
    second = np.array([1.0, -2.0, 1.0])
    bands = np.zeros((3, len(values)))
    for i in range(len(second)):
        for j in range(i, len(second)):
            stop = len(values) - len(second) + 1 + i
            bands[j - i, i:stop] += stiffness * second[i] * second[j]
    bands[0] += weights
    smooth: Floats = solveh_banded(bands, weights * values, lower=True)
    return smooth


def _leg(local: Floats, hip_pos: Floats, side: str, foot: FootPath) -> None:
    """Hip, knee, ankle and toes such that the foot follows its path and the knee is over the toes."""
    hip, knee, ankle, toes = (_INDEX[f"{side}_{j}"] for j in ("hip", "knee", "ankle", "foot"))
    pelvis_yaw = rot.yaw(local[:, 0])
    turned_out = (foot.yaw_rad - pelvis_yaw + np.pi) % (2 * np.pi) - np.pi
    knee_yaw = rot.about_y(pelvis_yaw + np.clip(0.85 * turned_out, -1.2, 1.2))  # (T, 4)
    bent = rot.multiply(knee_yaw, rot.from_rotvec(np.array([_BENT_RAD, 0.0, 0.0])))
    thigh = rot.multiply(knee_yaw, rot.from_rotvec(np.array([-_BENT_RAD, 0.0, 0.0])))
    knee_pos = hip_pos + rot.rotate(thigh, _SKELETON.offsets_m[knee])
    ankle_pos = knee_pos + rot.rotate(bent, _SKELETON.offsets_m[ankle])
    axis = rot.rotate(knee_yaw, np.array([1.0, 0.0, 0.0]))
    upper, lower = two_bone(hip_pos, knee_pos, ankle_pos, foot.ankle_m(), axis)
    thigh, shin = rot.multiply(upper, thigh), rot.multiply(lower, bent)
    foot_quat = foot.foot_quat()
    local[:, hip] = rot.multiply(rot.invert(local[:, 0]), thigh)
    local[:, knee] = rot.multiply(rot.invert(thigh), shin)
    local[:, ankle] = rot.multiply(rot.invert(shin), foot_quat)
    local[:, toes] = rot.multiply(rot.invert(foot_quat), foot.toe_quat())
