"""Training of the networks of `research/refined_takes.py`, all of them in turn, on CUDA as CUDA graphs."""

from __future__ import annotations

import copy
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

from choreograph.core.timebase import NET_FPS
from choreograph.motion.body import BODY_JOINTS
from research.real_from_real import Body
from research.real_or_built_in import balanced
from research.refiner import (
    CRITIC_FRAMES,
    LEGS,
    MADE_FRAMES,
    SMOOTH_S,
    UPPER,
    UPPER_TURNS,
    Convolutions,
    Refiner,
    Setting,
    bones_of,
    critics_for,
    forward_of,
    from_bones,
    joints_of,
    mirrored,
    noise_like,
    over_ground,
    penalty,
    smoothed,
    turned_by,
    velocities,
)

RATE, CRITIC_RATE = 4e-4, 2e-4
KEPT = 0.995  # of the running mean of the weights, which refines
MOST_STEPS = 40_000  # with windows of their own
BLUR_S = 0.3  # of the upper body that a regressor restores
LOWER = [0, *(joint for leg in LEGS for joint in leg)]
STARTS = (1.0, 4.0, 20.0)  # noise that diffusion starts from, in deviations of the directions of bones
LEAST_NOISE, DIFFUSION_STEPS = 0.02, 24


class Pool:
    """Windows of takes at random: genres weigh alike, and half of each batch is mirrored."""

    def __init__(self, takes: Sequence[Body], frames: int, batch: int, seed: int, device: str):
        starts, genres, parts, offset = [], [], [], 0
        for _, genre, _, pos in takes:
            own = np.arange(max(0, len(pos) - frames + 1))
            starts.append(offset + own)
            genres += [genre] * len(own)
            parts.append(pos)
            offset += len(pos)
        weights = balanced(np.array(genres))
        rng = np.random.default_rng(seed)
        drawn = rng.choice(np.concatenate(starts), (MOST_STEPS, batch), p=weights)
        self.frames = torch.from_numpy(np.concatenate(parts).astype(np.float32)).to(device)
        self.drawn = torch.from_numpy(drawn).to(device)
        self.span = torch.arange(frames, device=device)

    def batch(self, step: Tensor) -> Tensor:
        """The windows of a step, (B, T, 21, 3)."""
        at = self.drawn.index_select(0, step % MOST_STEPS)[0]
        pos = self.frames[at[:, None] + self.span]
        half = len(at) // 2
        return torch.cat([pos[:half], mirrored(pos[half:])])


def descend(loss: Tensor, net: nn.Module, optimizer: torch.optim.Optimizer) -> None:
    params = [p for p in net.parameters() if p.requires_grad]
    for param, grad in zip(params, torch.autograd.grad(loss, params, allow_unused=True), strict=True):
        param.grad = grad
    optimizer.step()


class Trained:
    """A network that is trained by steps, and the running mean of its weights."""

    def __init__(self, net: nn.Module, seed: int, device: str, rate: float = RATE):
        self.seed, self.device = seed, device
        self.net = net.to(device)
        self.mean = copy.deepcopy(self.net).requires_grad_(False)
        self.count = torch.zeros(1, dtype=torch.long, device=device)
        self.optimizer = self.adam(self.net, rate)

    def adam(self, net: nn.Module, rate: float) -> torch.optim.Optimizer:
        return torch.optim.Adam(net.parameters(), rate, (0.5, 0.99), capturable=self.device == "cuda")

    def step(self) -> None:
        """One step of training, of tensors alone, so that it can be a CUDA graph."""
        self.descend()
        self.count += 1
        with torch.no_grad():
            torch._foreach_lerp_(list(self.mean.parameters()), list(self.net.parameters()), 1 - KEPT)

    def descend(self) -> None:
        raise NotImplementedError

    def refined_batch(self, pos: Tensor, how: str) -> Tensor:
        raise NotImplementedError

    hows: tuple[str, ...] = ("",)

    def refined(self, takes: Iterable[np.ndarray], seed: int) -> dict[str, list[np.ndarray]]:
        """Takes (T, 21, 3) refined in each way that the network has."""
        torch.manual_seed(1000 + seed)
        takes = list(takes)
        longest = max(map(len, takes))
        whole = np.stack([np.pad(pos, ((0, longest - len(pos)), (0, 0), (0, 0)), "edge") for pos in takes])
        found = {}
        with torch.no_grad():
            parts = torch.from_numpy(whole).split(64)
            for how in self.hows:
                moved = torch.cat([self.refined_batch(part.to(self.device), how).cpu() for part in parts])
                found[how] = [after[: len(pos)] for after, pos in zip(moved.numpy(), takes, strict=True)]
        return found


class Adversary(Trained):
    """A refiner against critics, which are not what judges it."""

    def __init__(
        self, setting: Setting, made: Sequence[Body], real: Sequence[Body], seed: int, width: int,
        batch: int, device: str,
    ):  # fmt: skip
        super().__init__(Refiner(width, setting.held), seed, device, setting.rate)
        self.setting = setting
        self.made = Pool(made, MADE_FRAMES, batch, seed, device)
        self.real = Pool(real, CRITIC_FRAMES, batch, seed, device)
        seen = velocities(torch.cat([self.real.batch(self.count + i) for i in range(10)]))
        self.critics = critics_for(seen.std(dim=(0, 2))[:, None]).to(device)
        self.told = torch.full((len(self.critics),), 0.5, device=device)
        self.critics_optimizer = self.adam(self.critics, CRITIC_RATE)

    def descend(self) -> None:
        before = self.made.batch(self.count)
        after = self.net(before, noise_like(before))
        first = (MADE_FRAMES - CRITIC_FRAMES) // 2
        seen = velocities(after[:, first : first + CRITIC_FRAMES])
        real, fake = velocities(self.real.batch(self.count)).requires_grad_(), seen.detach()
        loss = torch.zeros((), device=self.device)
        for critic in self.critics:
            of_real = critic(real)
            (slope,) = torch.autograd.grad(of_real.sum(), real, create_graph=True)
            smooth = 0.5 * self.setting.r1 * (slope**2).sum(dim=(1, 2)).mean()
            loss = loss + nn.functional.softplus(-of_real).mean() + smooth
            loss = loss + nn.functional.softplus(critic(fake)).mean()
        descend(loss, self.critics, self.critics_optimizer)
        with torch.no_grad():  # the share of windows that critics tell, to follow the training
            right = [
                (critic(real) > 0).float().mean() + (critic(fake) < 0).float().mean()
                for critic in self.critics
            ]
            self.told.lerp_(torch.stack(right) / 2, 0.01)
        fooled = sum(nn.functional.softplus(-critic(seen)).mean() for critic in self.critics)
        descend(fooled + penalty(self.setting, before, after), self.net, self.optimizer)

    def refined_batch(self, pos: Tensor, how: str) -> Tensor:
        return self.mean(pos, noise_like(pos))


def with_bones(pos: Tensor, local: Tensor) -> Tensor:
    """Positions whose upper bones have the directions (B, T, 12, 3) in the frame of the dancer."""
    bones = bones_of(pos)
    world = turned_by(*forward_of(pos), local)
    world = world / (world.norm(dim=-1, keepdim=True) + 1e-6)
    upper = world * joints_of(bones, UPPER).norm(dim=-1, keepdim=True)
    n = len(BODY_JOINTS)
    order = [n + UPPER.index(joint) if joint in UPPER else joint for joint in range(n)]
    return from_bones(joints_of(torch.cat([bones, upper], dim=-2), order))


def directions(pos: Tensor) -> Tensor:
    """Directions (B, T, 12, 3) of the upper bones in the frame of the dancer."""
    sine, cosine = forward_of(pos)
    bones = joints_of(bones_of(pos), UPPER)
    return turned_by(-sine, cosine, bones / (bones.norm(dim=-1, keepdim=True) + 1e-6))


def blurred(pos: Tensor) -> Tensor:
    """Positions whose upper body moves as its smoothed copy."""
    local = directions(pos).flatten(2).transpose(1, 2)
    local = smoothed(local, BLUR_S * NET_FPS).transpose(1, 2).unflatten(-1, (len(UPPER), 3))
    return with_bones(pos, local)


class Denoiser(Trained):
    """A regressor of the upper body from its smoothed copy and the legs, trained on real takes alone."""

    hows = ("from the smoothed copy", "from the take itself")

    def __init__(self, real: Sequence[Body], seed: int, width: int, batch: int, device: str):
        super().__init__(Refiner(width, held=False, turns=UPPER_TURNS), seed, device)
        self.real = Pool(real, CRITIC_FRAMES, batch, seed, device)

    def descend(self) -> None:
        real = self.real.batch(self.count)
        given = blurred(real)
        apart = self.net(given, torch.zeros_like(noise_like(given))) - real
        steps = torch.diff(apart, dim=1) * NET_FPS
        descend((apart**2).mean() / 0.05**2 + (steps**2).mean() / 0.2**2, self.net, self.optimizer)

    def refined_batch(self, pos: Tensor, how: str) -> Tensor:
        given = blurred(pos) if how == self.hows[0] else pos
        return self.mean(given, torch.zeros_like(noise_like(given)))


class Diffusion(Trained):
    """A diffusion network of the upper body, given the legs, trained on real takes alone."""

    hows = tuple(f"noise {start:g}" for start in STARTS)

    def __init__(self, real: Sequence[Body], seed: int, width: int, batch: int, device: str):
        n = 3 * len(UPPER)
        super().__init__(
            Convolutions(n + 6 * len(LOWER) + 1, n, width, (1, 2, 4, 8, 1, 2, 4, 8)), seed, device
        )
        self.real = Pool(real, CRITIC_FRAMES, batch, seed, device)
        known = torch.cat([directions(self.real.batch(self.count + i)).flatten(2) for i in range(10)])
        self.centre, self.scale = known.mean(dim=(0, 1)), known.std(dim=(0, 1)) + 1e-3

    def legs(self, pos: Tensor) -> Tensor:
        """Positions and velocities of the lower body in the frame of the dancer, (B, 54, T)."""
        sine, cosine = forward_of(pos)
        step = torch.gradient(joints_of(pos, LOWER), dim=1)[0] * NET_FPS
        pose = joints_of(over_ground(pos), LOWER)
        parts = turned_by(-sine, cosine, pose), turned_by(-sine, cosine, step)
        return torch.cat([part.flatten(2) for part in parts], dim=-1).transpose(1, 2)

    def upper(self, pos: Tensor) -> Tensor:
        return ((directions(pos).flatten(2) - self.centre) / self.scale).transpose(1, 2)

    def clean(self, net: nn.Module, noisy: Tensor, legs: Tensor, sigma: Tensor) -> Tensor:
        """What the network takes for the directions without noise of a deviation (B, 1, 1)."""
        size = torch.sqrt(1 + sigma**2)
        level = (0.25 * torch.log(sigma)).expand(len(noisy), -1, noisy.shape[-1])
        return noisy / size**2 + sigma / size * net(torch.cat([noisy / size, legs, level], dim=1))

    def descend(self) -> None:
        real = self.real.batch(self.count)
        upper = self.upper(real)
        sigma = torch.exp(0.5 + 1.5 * torch.randn(len(upper), 1, 1, device=self.device))
        found = self.clean(self.net, upper + sigma * torch.randn_like(upper), self.legs(real), sigma)
        weight = (1 + sigma**2) / sigma**2
        descend((weight * (found - upper) ** 2).mean(), self.net, self.optimizer)

    def refined_batch(self, pos: Tensor, how: str) -> Tensor:
        start = STARTS[self.hows.index(how)]
        legs, upper = self.legs(pos), self.upper(pos)
        levels = torch.logspace(np.log10(start), np.log10(LEAST_NOISE), DIFFUSION_STEPS, device=self.device)
        upper = upper + start * torch.randn_like(upper)
        for now, then in pairwise(levels):
            found = self.clean(self.mean, upper, legs, now.reshape(1, 1, 1))
            upper = found + then / now * (upper - found)
        local = upper.transpose(1, 2) * self.scale + self.centre
        local = smoothed(local.transpose(1, 2), 0.5 * SMOOTH_S * NET_FPS).transpose(1, 2)
        return with_bones(pos, local.unflatten(-1, (len(UPPER), 3)))


def captured(trained: Trained) -> torch.cuda.CUDAGraph:
    """The step of a network as a CUDA graph."""
    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        for _ in range(3):
            trained.step()
    torch.cuda.synchronize()
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph, stream=stream):
        trained.step()
    torch.cuda.synchronize()
    graph.replay()
    torch.cuda.synchronize()
    return graph


def train(
    networks: Mapping[str, Trained], seconds: float, shares: Sequence[float], eager: bool = False
) -> Iterator[tuple[float, Mapping[str, Trained]]]:
    """Train all networks for some seconds together, and yield them at shares of the time."""
    on_cuda = torch.cuda.is_available() and not eager
    graphs = {name: captured(network) for name, network in networks.items()} if on_cuda else {}
    spent_s, steps = 0.0, 0
    for share in sorted(shares):
        begun = time.monotonic()
        while spent_s + time.monotonic() - begun < share * seconds:
            for _ in range(20 if on_cuda else 1):
                for name, network in networks.items():
                    if on_cuda:
                        graphs[name].replay()
                    else:
                        network.step()
                steps += 1
            if on_cuda:
                torch.cuda.synchronize()
        spent_s += time.monotonic() - begun
        for name, network in networks.items():
            if isinstance(network, Adversary):
                print(f"{name}: critics tell {network.told.tolist()}")
        print(f"{steps} steps in {spent_s:.0f} s", flush=True)
        yield share, networks
