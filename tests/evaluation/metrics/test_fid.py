"""FID and its features against plain loops of the published formulas, known motions and a golden file."""

from __future__ import annotations

import numpy as np
import pytest
from golden.regenerate import fid_features, golden
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import fid, frechet
from choreograph.formats.register import import_takes
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton

INDEX = {name: i for i, name in enumerate(CANONICAL_JOINTS)}
VARIANTS = ("published", "corrected")
NAMES = (
    "hand forward R", "hand forward L", "hand up R", "hand up L", "hand rises R", "hand rises L",
    "elbow bent R", "elbow bent L", "hands apart", "hands meet", "hand leaves R", "hand leaves L",
    "hand fast R", "hand fast L", "foot behind R", "foot behind L", "foot raised R", "foot raised L",
    "feet apart", "knee bent R", "knee bent L", "foot fast R", "foot fast L", "arm off R", "arm off L",
    "thigh off R", "thigh off L", "pelvis behind", "lies", "hand low R", "hand low L", "fast",
)  # fmt: skip


def _dance(seed: int, n_frames: int = 150, fps: float = 60.0) -> Motion:
    rng = np.random.default_rng(seed)
    times_s = np.arange(n_frames)[:, None, None] / fps
    phase, pace, size = rng.uniform(0, 6, (24, 3)), rng.uniform(2, 9, (24, 3)), rng.uniform(0.1, 0.6, (24, 3))
    quat = rot.from_rotvec(size * np.sin(pace * times_s + phase))
    root = canonical_skeleton().offsets_m[0] + 0.4 * np.sin(times_s[:, 0] * rng.uniform(1, 3, 3))
    return Motion(canonical_skeleton(), root, rot.make_continuous(quat), fps)


def _standing(n_frames: int = 61) -> np.ndarray:
    """The canonical body with its arms down, (T, 24, 3)."""
    quat = np.tile(rot.IDENTITY, (n_frames, 24, 1))
    for side, sign in (("left", -1), ("right", 1)):
        quat[:, INDEX[f"{side}_shoulder"]] = rot.from_rotvec(np.array([0.0, 0.0, sign * 1.5]))
    skeleton = canonical_skeleton()
    return Motion(skeleton, np.tile(skeleton.offsets_m[0], (n_frames, 1)), quat, 60.0).joint_pos_m()


def _moved(joint: str, velocity_m_s: tuple[float, float, float]) -> np.ndarray:
    pos = _standing(7)
    pos[:, INDEX[joint]] += np.arange(-3, 4)[:, None] / 60.0 * np.array(velocity_m_s)
    return pos


def _geometric(pos: np.ndarray, variant: fid.Variant = "corrected") -> dict[str, float]:
    return dict(zip(NAMES, fid.geometric(pos, 60.0, variant=variant).tolist(), strict=True))


def _kinetic_by_loops(pos: np.ndarray, *, bracket_misplaced: bool) -> np.ndarray:
    pos, dt, n = pos - pos[0, 0], 1 / 60, len(pos)
    rows = []
    for j in range(24):
        level, upright, effort = 0.0, 0.0, 0.0
        for i in range(1, n):
            steps = [pos[k, j] - pos[k - 1, j] for k in range(max(i - 2, 1), min(i + 2, n - 1) + 1)]
            v = np.mean(steps, axis=0) / dt
            level, upright = level + v[0] ** 2 + v[2] ** 2, upright + v[1] ** 2
            bends = []
            for k in range(max(i - 2, 1), min(i + 2, n - 2) + 1):
                later = (pos[k + 1, j] - pos[k, j]) / dt
                earlier = (
                    pos[k, j] - pos[k - 1, j] / dt if bracket_misplaced else (pos[k, j] - pos[k - 1, j]) / dt
                )
                bends.append((later - earlier) / dt)
            effort += np.linalg.norm(np.mean(bends, axis=0))
        rows += [level / (n - 1), upright / (n - 1), effort / (n - 1)]
    return np.array(rows)


@pytest.mark.parametrize("n_frames", [3, 4, 5, 6, 40])
def test_kinetic_features_equal_plain_loops(n_frames):
    pos = _dance(1, n_frames).joint_pos_m()
    for variant in VARIANTS:
        wanted = _kinetic_by_loops(pos, bracket_misplaced=variant == "published")
        assert np.allclose(fid.kinetic(pos, 60.0, variant=variant), wanted, rtol=1e-9)


def test_kinetic_features_of_known_motions():
    """A body that moves at 3 m/s horizontally and 2 m/s vertically, and one that falls at 9.81 m/s²."""
    times_s = np.arange(121)[:, None, None] / 60
    moving = fid.kinetic(_standing(121) + times_s * [1.8, 2.0, 2.4], 60.0).reshape(24, 3)
    assert np.allclose(moving, [9.0, 4.0, 0.0], atol=1e-8)
    falling = fid.kinetic(_standing(121) - 0.5 * 9.81 * times_s**2 * [0.0, 1.0, 0.0], 60.0).reshape(24, 3)
    assert np.allclose(falling[:, 2], 9.81)
    still = fid.kinetic(_standing(), 60.0, variant="published").reshape(24, 3)
    reach_m = np.linalg.norm(_standing()[0] - _standing()[0, 0], axis=-1)
    assert np.allclose(still[:, 2], reach_m * 60 * (60 - 1), rtol=1e-9)  # of a body that does not move


def _published_relation(pos: np.ndarray, t: int, row: int) -> bool:
    """Some rows by fairmotion's formulas at 1/120 s, as an oracle for the table."""
    now, before = ({name: frame[i] for name, i in INDEX.items()} for frame in (pos[t], pos[t - 1]))
    humerus = 0.2568381092

    def moves(a, b, c, least):  # c against a, along a → b
        along = now[b] - now[a]
        step = (now[c] - now[a]) - (before[c] - before[a])
        return step @ along / np.linalg.norm(along) * 120 > least * humerus

    def leaves_plane(a, b, c, d, least):
        normal = np.cross(now[c] - now[a], now[b] - now[a])
        step = (now[d] - now[a]) - (before[d] - before[a])
        return step @ normal / np.linalg.norm(normal) * 120 > least * humerus

    def off_plane(a, b, c, d, least):
        normal = np.cross(now[c] - now[a], now[b] - now[a])
        return (now[d] - now[a]) @ normal / np.linalg.norm(normal) > least * humerus

    return {
        0: lambda: leaves_plane("neck", "right_hip", "left_hip", "right_wrist", 1.8),
        1: lambda: leaves_plane("neck", "left_hip", "right_hip", "left_wrist", 1.8),
        4: lambda: moves("spine1", "spine3", "spine3", 1.8),
        9: lambda: moves("left_wrist", "right_wrist", "right_wrist", 1.4),
        10: lambda: moves("right_wrist", "pelvis", "left_wrist", 1.4),
        11: lambda: moves("left_wrist", "pelvis", "right_wrist", 1.4),
        14: lambda: off_plane("pelvis", "left_hip", "left_foot", "right_ankle", 0.38),
        15: lambda: off_plane("pelvis", "right_hip", "right_foot", "left_ankle", 0.38),
        27: lambda: off_plane("right_ankle", "neck", "left_ankle", "pelvis", 0.5),
        29: lambda: -(now["right_wrist"][1] - pos[t, :, 1].min()) > -1.2 * humerus,
        31: lambda: np.linalg.norm(now["pelvis"] - before["pelvis"]) * 120 > 2.3 * humerus,
    }[row]()


@pytest.mark.parametrize("row", [0, 1, 4, 9, 10, 11, 14, 15, 27, 29, 31])
def test_published_relations_equal_the_formulas(row):
    pos = _dance(2).joint_pos_m()
    wanted = np.mean([_published_relation(pos, t, row) for t in range(1, len(pos))])
    assert fid.geometric(pos, 60.0, variant="published")[row] == pytest.approx(wanted)


def test_no_relation_holds_for_a_standing_body():
    assert {name for name, share in _geometric(_standing()).items() if share} == set()


@pytest.mark.parametrize(
    ("joint", "velocity_m_s", "name", "wrong_way"),
    [
        ("right_wrist", (0, 0, 1.0), "hand forward R", "hand forward L"),
        ("left_wrist", (0, 0, 1.0), "hand forward L", "hand forward R"),
        ("right_wrist", (0, 1.0, 0), "hand rises R", "hand rises L"),
        ("left_wrist", (0, 1.0, 0), "hand rises L", "hand rises R"),
        ("left_wrist", (-1.0, 0, 0), "hands meet", "hand leaves L"),
        ("left_wrist", (1.0, 0, 0), "hand leaves L", "hands meet"),
        ("right_wrist", (-1.0, 0, 0), "hand leaves R", "hands meet"),
        ("right_ankle", (0, 0, 1.0), "foot fast R", "foot fast L"),
    ],
)
def test_a_moving_joint_triggers_only_its_relation(joint, velocity_m_s, name, wrong_way):
    shares = _geometric(_moved(joint, velocity_m_s))
    assert shares[name] == 1.0
    assert shares[wrong_way] == 0.0
    backward = _geometric(_moved(joint, tuple(-x for x in velocity_m_s)))
    assert backward[name] == (1.0 if name.startswith("foot fast") else 0.0)


def test_the_published_variant_keeps_the_published_bugs():
    """The right hand counts when it moves back, the left one forward; parting hands count as meeting."""
    forward = _geometric(_moved("right_wrist", (0, 0, 1.0)), "published")
    back = _geometric(_moved("right_wrist", (0, 0, -1.0)), "published")
    assert (forward["hand forward R"], back["hand forward R"]) == (0.0, 1.0)
    assert _geometric(_moved("left_wrist", (0, 0, 1.0)), "published")["hand forward L"] == 1.0
    assert _geometric(_moved("right_wrist", (0, 1.0, 0)), "published")["hand rises R"] == 0.0
    assert _geometric(_moved("left_wrist", (1.0, 0, 0)), "published")["hands meet"] == 1.0
    slow = _moved("pelvis", (0.4, 0, 0))  # 0.4 m/s is below 2.3 humeri a second, 0.8 is not
    assert _geometric(slow)["fast"] == 0.0 and _geometric(slow, "published")["fast"] == 1.0


def test_feet_planes():
    pos = _standing()
    pos[:, INDEX["right_ankle"], 2] -= 0.4
    assert (_geometric(pos)["foot behind R"], _geometric(pos, "published")["foot behind R"]) == (1.0, 0.0)
    pos = _standing()
    pos[:, INDEX["left_ankle"], 2] -= 0.4
    assert (_geometric(pos)["foot behind L"], _geometric(pos, "published")["foot behind L"]) == (1.0, 1.0)
    pos = _standing()
    pos[:, INDEX["pelvis"], 2] -= 0.4
    assert (_geometric(pos)["pelvis behind"], _geometric(pos, "published")["pelvis behind"]) == (1.0, 0.0)


@settings(max_examples=20)
@given(seed=st.integers(0, 99), yaw=st.floats(-3.1, 3.1), x=st.floats(-9, 9), size=st.floats(0.5, 2))
def test_position_and_heading_do_not_matter_when_corrected_nor_size_for_relations(seed, yaw, x, size):
    pos = _dance(seed, 60).joint_pos_m()
    moved = rot.rotate(rot.about_y(yaw), pos) + np.array([x, 0.3, -x])
    assert np.allclose(fid.kinetic(moved, 60.0), fid.kinetic(pos, 60.0), rtol=1e-6)
    assert np.abs(fid.geometric(moved, 60.0) - fid.geometric(pos, 60.0)).max() <= 1.5 / 59
    assert np.abs(fid.geometric(size * pos, 60.0) - fid.geometric(pos, 60.0)).max() <= 1.5 / 59


@settings(max_examples=20)
@given(seed=st.integers(0, 99))
def test_a_mirror_swaps_left_and_right_in_corrected_features(seed):
    pos = _dance(seed, 60).joint_pos_m()
    flip = [
        INDEX[n.replace("left", "#").replace("right", "left").replace("#", "right")] for n in CANONICAL_JOINTS
    ]
    mirrored = pos[:, flip] * [-1.0, 1.0, 1.0]
    sides = [
        NAMES.index(n[:-1] + "RL"["LR".index(n[-1])]) if n[-2:] in (" L", " R") else i
        for i, n in enumerate(NAMES)
    ]
    assert np.abs(fid.geometric(mirrored, 60.0) - fid.geometric(pos, 60.0)[sides]).max() <= 1.5 / 59
    assert np.allclose(
        fid.kinetic(mirrored, 60.0).reshape(24, 3), fid.kinetic(pos, 60.0).reshape(24, 3)[flip]
    )


def test_the_rate_hardly_matters():
    fast, slow = _dance(3, 601), _dance(3, 301, 30.0)
    k = [fid.kinetic(m.joint_pos_m(), m.fps) for m in (fast, slow)]
    g = [fid.geometric(m.joint_pos_m(), m.fps) for m in (fast, slow)]
    assert np.allclose(*k, rtol=0.02) and np.abs(g[0] - g[1]).max() < 0.02


def test_pieces():
    motion = _dance(4, 500)
    assert fid.features_of([motion], piece_s=2.0).kinetic.shape == (4, 72)
    assert fid.features_of([motion, motion.sliced(0, 60)], piece_s=20.0).geometric.shape == (2, 32)
    second = fid.features_of([motion.sliced(120, 240)], piece_s=2.0)
    assert np.allclose(fid.features_of([motion], piece_s=2.0).kinetic[1], second.kinetic[0])


def test_scores_of_known_features():
    real = np.array([[0.0, 0.0], [2.0, 6.0], [0.0, 6.0], [2.0, 0.0]])  # means 1, 3; spreads 1, 3
    assert fid.fid(real, real) == pytest.approx(0, abs=1e-12)
    assert fid.fid(real + np.array([3.0, 0.0]), real) == pytest.approx(9.0)
    assert fid.fid(real + np.array([0.0, 3.0]), real) == pytest.approx(1.0)
    assert fid.fid(real + np.array([0.0, 3.0]), real, normalised=False) == pytest.approx(9.0)
    assert fid.diversity(real, real) == pytest.approx((4 * 2.0 + 2 * 8**0.5) / 6)
    assert fid.diversity(real, real, normalised=False) == pytest.approx((2 * 2 + 2 * 6 + 2 * 40**0.5) / 6)


def test_a_constant_feature_explodes_only_when_published():
    real, ours = np.array([[0.0, 1.0], [0.0, 2.0]]), np.array([[0.1, 1.0], [0.1, 2.0]])
    assert fid.fid(ours, real) == pytest.approx(0.01)
    assert fid.fid(ours, real, variant="published") == pytest.approx(1e18, rel=1e-6)


def test_malformed():
    good = _standing()
    broken = good.copy()
    broken[3, 2, 1] = np.nan
    for pos, fps in ((good[:, :21], 60.0), (broken, 60.0), (good[:2], 60.0), (good[:0], 60.0), (good, 0.0)):
        with pytest.raises(ParameterError, match="expected"):
            fid.kinetic(pos, fps)
    with pytest.raises(ParameterError, match="got 'old'"):
        fid.geometric(good, 60.0, variant="old")
    with pytest.raises(ParameterError, match="at least one motion"):
        fid.features_of([])
    with pytest.raises(ParameterError, match="2 or more"):
        fid.fid(np.zeros((1, 3)), np.zeros((4, 3)))
    sets = [fid.features_of([_dance(5), _dance(6)], variant=variant) for variant in VARIANTS]
    with pytest.raises(ParameterError, match="one variant"):
        fid.evaluate(*sets)


def test_no_relation_holds_if_all_joints_coincide():
    shares = _geometric(np.zeros((10, 24, 3)))
    assert not any(shares.values())


def test_golden():
    wanted = golden("fid")
    for key, values in fid_features().items():
        assert values == pytest.approx(wanted[key], rel=1e-6, abs=1e-9), key


def test_the_tables_differ_in_the_corrections_only():
    same = [a == b for a, b in zip(fid.PUBLISHED_RELATIONS, fid.CORRECTED_RELATIONS, strict=True)]
    assert [i for i, equal in enumerate(same) if not equal] == [0, 4, 5, 9, 10, 11, 14, 15, 27]


def test_real_dances_score_better_than_chance(shared_data):
    folders = [shared_data / "dance-with-melody" / f"DANCE_{name}" for name in ("C_2", "C_4", "W_12", "W_22")]
    motions = [take.motion for folder in folders for take in import_takes(folder)]
    real = fid.features_of([motions[0], motions[2]], piece_s=5.0)
    others = [motions[1], motions[3]]
    rng = np.random.default_rng(0)
    scores = fid.evaluate(fid.features_of(others, piece_s=5.0), real)
    still = fid.evaluate(fid.features_of([frechet.still(m, rng) for m in others], piece_s=5.0), real)
    mixed = fid.evaluate(
        fid.features_of([frechet.shuffled_joints(m, rng) for m in others], piece_s=5.0), real
    )
    assert scores["fid_g"] < still["fid_g"] and scores["fid_g"] < mixed["fid_g"]
    assert scores["fid_k"] < mixed["fid_k"]
    assert still["diversity_k"] < 1e-6
