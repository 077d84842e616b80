"""Networks that refine the motion of takes: what they turn, what holds the feet, and how they are trained.

Conventions: body positions (B, T, 21, 3) are in metres at 20 fps. Channels of networks are (B, C, T). The
refiner turns the bones of a body about the joint that they hang on, so that no bone changes its length, and
bones of one joint (hips and spine, collars and neck) stay rigid. The feet either stay exactly where they are
("held": legs follow by two-bone inverse kinematics), or turn as all else does ("free").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import torch
from torch import Tensor, nn

from choreograph.core.timebase import NET_FPS
from choreograph.motion.body import BODY_JOINTS, BODY_PARENTS, LEFT_RIGHT

SMOOTH_S = 0.1  # as in `real_or_built_in.py`: of what critics see, and of what the refiner adds
CRITIC_FRAMES = 80  # windows of the critics, before smoothing
MADE_FRAMES = 128  # windows of the refiner, of which critics see the middle
CONTACT_M_S = 0.1
NOISE = 8  # channels that are constant in a window, and as many that vary slowly
NOISE_S = 0.5
REACH = 0.9995  # share of a straight leg that a held leg is stretched to at most
FEET = tuple(i for i, name in enumerate(BODY_JOINTS) if name.endswith(("ankle", "foot")))
INDEX = {name: index for index, name in enumerate(BODY_JOINTS)}
LEGS = [[INDEX[f"{side}_{j}"] for j in ("hip", "knee", "ankle", "foot")] for side in ("left", "right")]
UPPER = [i for i, n in enumerate(BODY_JOINTS) if not n.endswith(("pelvis", "hip", "knee", "ankle", "foot"))]
UPPER_TURNS = sorted({BODY_PARENTS[i] for i in UPPER} - {INDEX["pelvis"]})
HELD_TURNS = [INDEX["pelvis"], *UPPER_TURNS]
ALL_TURNS = sorted(set(BODY_PARENTS) - {-1})


@cache
def constant(values: tuple[float, ...] | tuple[int, ...], device: torch.device) -> Tensor:
    """Numbers on a device, copied to it once, since a CUDA graph cannot copy."""
    return torch.tensor(values, device=device)


def joints_of(pos: Tensor, joints: Sequence[int]) -> Tensor:
    """Some joints of positions (B, T, 21, 3), or as many as are named."""
    return pos.index_select(-2, constant(tuple(joints), pos.device))


def over_ground(pos: Tensor) -> Tensor:
    """Positions from the point of the floor below the pelvis."""
    return pos - pos[..., :1, :] * constant((1.0, 0.0, 1.0), pos.device)


def gaussian(signal: Tensor, sigma: float) -> Tensor:
    """Channels (B, C, T) smoothed over time with a deviation in frames, without the frames at the ends."""
    reach = int(4 * sigma + 0.5)
    at = torch.arange(-reach, reach + 1, device=signal.device, dtype=signal.dtype)
    kernel = torch.exp(-0.5 * (at / sigma) ** 2)
    flat = signal.reshape(-1, 1, signal.shape[-1])
    return nn.functional.conv1d(flat, (kernel / kernel.sum())[None, None]).reshape(*signal.shape[:-1], -1)


def smoothed(signal: Tensor, sigma: float) -> Tensor:
    """`gaussian` with all frames: those at the ends are repeated."""
    reach = int(4 * sigma + 0.5)
    return gaussian(nn.functional.pad(signal, (reach, reach), mode="replicate"), sigma)


def forward_of(pos: Tensor) -> tuple[Tensor, Tensor]:
    """Sine and cosine (B, T) of the heading, as `choreograph.motion.body.heading_rad`."""
    across = sum(
        pos[..., INDEX[f"left_{part}"], :] - pos[..., INDEX[f"right_{part}"], :]
        for part in ("hip", "shoulder")
    )
    size = torch.sqrt(across[..., 0] ** 2 + across[..., 2] ** 2 + 1e-12)
    return -across[..., 2] / size, across[..., 0] / size


def turned_by(sine: Tensor, cosine: Tensor, vectors: Tensor) -> Tensor:
    """Vectors (B, T, J, 3) turned about Y by an angle (B, T)."""
    s, c = sine[..., None], cosine[..., None]
    x, y, z = vectors.unbind(-1)
    return torch.stack([c * x + s * z, y, c * z - s * x], dim=-1)


def velocities(pos: Tensor) -> Tensor:
    """What the judges see: velocities in the root frame of smoothed positions, (B, 63, T - 18)."""
    batch, frames = pos.shape[:2]
    smooth = gaussian(pos.reshape(batch, frames, -1).transpose(1, 2), SMOOTH_S * NET_FPS)
    smooth = smooth.transpose(1, 2).reshape(batch, -1, len(BODY_JOINTS), 3)
    step = (smooth[:, 2:] - smooth[:, :-2]) * (NET_FPS / 2)
    sine, cosine = forward_of(smooth[:, 1:-1])
    return turned_by(-sine, cosine, step).flatten(2).transpose(1, 2)


def mirrored(pos: Tensor) -> Tensor:
    """Positions with X negated and left and right exchanged."""
    order = list(range(len(BODY_JOINTS)))
    for left, right in LEFT_RIGHT:
        order[left], order[right] = right, left
    return joints_of(pos, order) * constant((-1.0, 1.0, 1.0), pos.device)


def rotated(vectors: Tensor, turns: Tensor) -> Tensor:
    """Vectors (..., 3) rotated by rotation vectors (..., 3) in radians."""
    angle = torch.sqrt((turns**2).sum(-1, keepdim=True) + 1e-10)
    once = torch.linalg.cross(turns, vectors)
    twice = torch.linalg.cross(turns, once)
    return vectors + torch.sin(angle) / angle * once + (1 - torch.cos(angle)) / angle**2 * twice


def from_bones(bones: Tensor) -> Tensor:
    """Positions of bones (B, T, 21, 3): the sum of the bones from the pelvis to each joint."""
    sums = [[0.0] * len(BODY_JOINTS) for _ in BODY_JOINTS]
    for joint, parent in enumerate(BODY_PARENTS):
        sums[joint] = list(sums[parent]) if parent >= 0 else sums[joint]
        sums[joint][joint] = 1.0
    flat = constant(tuple(value for row in sums for value in row), bones.device)
    return torch.einsum("ij,btjc->btic", flat.unflatten(0, (len(BODY_JOINTS), -1)), bones)


def bones_of(pos: Tensor) -> Tensor:
    """Vectors (B, T, 21, 3) from the parent of each joint to it. That of the pelvis is its position."""
    parents = [max(0, parent) for parent in BODY_PARENTS]
    bones = pos - joints_of(pos, parents)
    return torch.cat([pos[..., :1, :], bones[..., 1:, :]], dim=-2)


def with_held_feet(pos: Tensor, before: Tensor, swivel_rad: Tensor) -> Tensor:
    """Legs from the hips of `pos` to the feet of `before`, with the knees turned about them by (B, T, 2).

    A foot that a leg does not reach is pulled towards the hip.
    """
    moved = {}
    for side, (hip, knee, ankle, foot) in enumerate(LEGS):
        upper = (before[..., knee, :] - before[..., hip, :]).norm(dim=-1, keepdim=True)
        lower = (before[..., ankle, :] - before[..., knee, :]).norm(dim=-1, keepdim=True)
        leg = before[..., ankle, :] - pos[..., hip, :]
        length = torch.sqrt((leg**2).sum(-1, keepdim=True) + 1e-8)
        axis = leg / length
        length = torch.minimum(length, REACH * (upper + lower))
        along = (upper**2 - lower**2 + length**2) / (2 * length)
        out = torch.sqrt(torch.clamp(upper**2 - along**2, min=1e-6))
        # A straight leg bends to where its foot points.
        bend = before[..., knee, :] - 0.5 * (before[..., hip, :] + before[..., ankle, :])
        bend = bend + 0.05 * (before[..., foot, :] - before[..., ankle, :])
        bend = bend - (bend * axis).sum(-1, keepdim=True) * axis
        bend = bend / torch.sqrt((bend**2).sum(-1, keepdim=True) + 1e-8)
        bend = rotated(bend, axis * swivel_rad[..., side, None])
        moved[knee] = pos[..., hip, :] + along * axis + out * bend
        moved[ankle] = pos[..., hip, :] + length * axis
        moved[foot] = moved[ankle] + before[..., foot, :] - before[..., ankle, :]
    return torch.stack([moved.get(j, pos[..., j, :]) for j in range(len(BODY_JOINTS))], dim=-2)


class Convolutions(nn.Module):
    """Residual dilated convolutions from channels (B, C, T) to others."""

    def __init__(self, n_in: int, n_out: int, width: int, dilations: Sequence[int], zero: bool = True):
        super().__init__()
        self.first = nn.Conv1d(n_in, width, 5, padding="same")
        self.blocks = nn.ModuleList(
            nn.Sequential(
                nn.GELU(), nn.Conv1d(width, width, 5, padding="same", dilation=d),
                nn.GELU(), nn.Conv1d(width, width, 1),
            )
            for d in dilations
        )  # fmt: skip
        self.last = nn.Conv1d(width, n_out, 1)
        if zero:
            nn.init.zeros_(self.last.weight)
            nn.init.zeros_(self.last.bias)

    def forward(self, signal: Tensor) -> Tensor:
        hidden = self.first(signal)
        for block in self.blocks:
            hidden = hidden + 0.5 * block(hidden)
        return self.last(hidden)


class Refiner(nn.Module):
    """Turns the bones of a body and shifts its pelvis, from the motion and noise."""

    def __init__(self, width: int, held: bool, turns: Sequence[int] | None = None):
        super().__init__()
        self.held = held
        self.turns = list(turns if turns is not None else HELD_TURNS if held else ALL_TURNS)
        self.shifts = turns is None
        n_out = 3 * len(self.turns) + 3 + 2  # turns, the shift of the pelvis, and both knees about the legs
        self.net = Convolutions(126 + 2 * NOISE, n_out, width, (1, 2, 4, 1, 2, 4))

    def forward(self, pos: Tensor, noise: Tensor) -> Tensor:
        sine, cosine = forward_of(pos)
        pose = turned_by(-sine, cosine, over_ground(pos))
        step = torch.gradient(pos, dim=1)[0] * NET_FPS
        seen = torch.cat([pose.flatten(2), turned_by(-sine, cosine, step).flatten(2)], dim=-1)
        out = self.net(torch.cat([seen.transpose(1, 2), noise], dim=1))
        out = smoothed(out, SMOOTH_S * NET_FPS).transpose(1, 2)  # (B, T, n_out)
        n = len(self.turns)
        local = turned_by(sine, cosine, out[..., : 3 * n].unflatten(-1, (n, 3)))
        # The turn of each bone is that of its parent, or none.
        none = torch.zeros_like(local[..., :1, :])
        of_bones = [self.turns.index(p) if p in self.turns else n for p in BODY_PARENTS]
        bones = rotated(bones_of(pos), joints_of(torch.cat([local, none], dim=-2), of_bones))
        if self.shifts:
            shift = turned_by(sine, cosine, 0.3 * out[..., None, 3 * n : 3 * n + 3])
            bones = torch.cat([bones[..., :1, :] + shift, bones[..., 1:, :]], -2)
        moved = from_bones(bones)
        return with_held_feet(moved, pos, out[..., 3 * n + 3 :]) if self.held else moved


def noise_like(pos: Tensor) -> Tensor:
    """Noise (B, 16, T) for windows: half of its channels are constant, half vary slowly."""
    batch, frames = pos.shape[:2]
    constant = torch.randn(batch, NOISE, 1, device=pos.device).expand(-1, -1, frames)
    sigma = NOISE_S * NET_FPS
    slow = torch.randn(batch, NOISE, frames + 2 * int(4 * sigma + 0.5), device=pos.device)
    return torch.cat([constant, gaussian(slow, sigma) * (2 * sigma * 3.1416**0.5) ** 0.5], dim=1)


class Critic(nn.Module):
    """Tells velocities (B, 63, T) of real takes from others, by the means of what convolutions see."""

    def __init__(self, width: int, kernel: int, dilations: Sequence[int], scale: Tensor):
        super().__init__()
        self.register_buffer("scale", scale)
        self.first = nn.Conv1d(63, width, kernel)
        self.rest = nn.ModuleList(nn.Conv1d(width, width, kernel, dilation=d) for d in dilations)
        self.last = nn.Sequential(nn.Linear(2 * width, width), nn.GELU(), nn.Linear(width, 1))

    def forward(self, velocity: Tensor) -> Tensor:
        hidden = nn.functional.gelu(self.first(velocity / self.scale))
        for layer in self.rest:
            hidden = nn.functional.gelu(layer(hidden))
        spread = torch.sqrt(hidden.var(dim=-1) + 1e-4)
        return self.last(torch.cat([hidden.mean(dim=-1), spread], dim=1))[:, 0]


def critics_for(scale: Tensor) -> nn.ModuleList:
    """Critics of three sizes: as the judges, wider with a longer view, and of single frames."""
    sizes = ((32, 5, (2,)), (128, 5, (1, 2, 4)), (128, 1, (1,)))
    return nn.ModuleList(Critic(width, kernel, dilations, scale) for width, kernel, dilations in sizes)


@dataclass(frozen=True)
class Setting:
    """How a refiner is trained."""

    name: str
    trained_on: str = "all"  # the real takes of the critics
    held: bool = True  # feet exactly, or only while they stand
    residual: float = 0.2  # weight of the squared distance that joints move, of 0.1 m
    feet: float = 1.0  # weight of feet that stand and move, where they are not held
    r1: float = 10.0  # weight of the squared gradients of the critics at real takes
    rate: float = 4e-4  # of learning, of the refiner
    timing: float = 0.0  # weight of changes of the body's speed over time


def penalty(setting: Setting, before: Tensor, after: Tensor) -> Tensor:
    """What it costs to move joints, feet that stand, and the times when the body is fast."""
    apart = ((after - before) ** 2).sum(-1)  # (B, T, 21)
    cost = setting.residual * apart.mean() / 0.1**2
    if setting.held:
        cost = cost + setting.feet * apart.index_select(-1, constant(FEET, apart.device)).mean() / 0.02**2
    else:
        speed = torch.gradient(joints_of(before, FEET), dim=1)[0].norm(dim=-1) * NET_FPS
        stands = (speed < CONTACT_M_S).to(apart.dtype)
        of_feet = apart.index_select(-1, constant(FEET, apart.device))
        cost = cost + setting.feet * (stands * of_feet).mean() / 0.02**2
    if setting.timing:
        curves = [torch.diff(pos, dim=1).norm(dim=-1).mean(-1) for pos in (before, after)]
        curves = [curve / (curve.mean(1, keepdim=True) + 1e-4) for curve in curves]
        cost = cost + setting.timing * ((curves[1] - curves[0]) ** 2).mean()
    return cost
