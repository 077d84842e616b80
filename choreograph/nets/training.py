"""The training loop of every network: steps, schedule, checkpoints, log and progress.

The random numbers of a step depend only on the seed and the step's number. So a checkpoint needs no generator
state, and an interrupted and resumed run ends with exactly the weights of an uninterrupted one. A checkpoint
of other takes, songs or options is not continued, nor is a damaged one. Training then starts again, with a
note that states the reason.

Several processes of `torchrun` can share the steps (`nets.processes`). Only the first of them has files,
reports and notes.
"""

from __future__ import annotations

import copy
import io
import json
import math
import pickle
import signal
import struct
import threading
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from choreograph.core.arguments import check_choice
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.files import atomic_path, writing
from choreograph.nets.configs import DEVICES
from choreograph.nets.processes import (
    agreed,
    average_gradients,
    call_elsewhere,
    from_first,
    process_index,
    shared_batch_norms,
)

CHECKPOINT_EVERY_S = 30.0
LOG_LINES = 200  # of a run of any length, about
_SEED_STRIDE = 0x9E3779B9  # spreads seed and step over torch's seeds
# The same for processes, whose rows have dropout of their own. On the CPU, torch uses 32 bits of a seed.
_PROCESS_STRIDE = 0x85EBCA6B

# The errors of torch and zipfile for a file that is not a checkpoint. It depends on the bytes which is
# raised.
_UNREADABLE = (
    OSError, EOFError, RuntimeError, ValueError, TypeError, KeyError, IndexError, AttributeError,
    AssertionError, OverflowError, MemoryError, struct.error, zipfile.BadZipFile, pickle.UnpicklingError,
)  # fmt: skip

Loss = Callable[[Any, torch.device], Tensor]
Prepare = Callable[[np.random.Generator], Any]


@dataclass(frozen=True)
class TrainingProgress:
    """The progress of the training of one network."""

    name: str  # of the network
    step: int  # steps done
    n_steps: int  # steps in all
    loss: float  # mean since the last report
    seconds_left: float  # estimated from the steps done


@dataclass(frozen=True)
class TrainingContext:
    """Where and how a training runs, independent of the network."""

    folder: Path | None = None  # of the checkpoint NAME.pt and the log NAME.jsonl, or None for neither
    resume: bool = False  # from the checkpoint, if there is one
    device: str = "auto"
    precision: str = "float32"  # of products in networks, or "bfloat16"
    report: Callable[[TrainingProgress], None] = lambda progress: None
    # Training data and settings other than the configuration of the network: name -> checksum or setting. A
    # checkpoint with other content is not continued.
    content: Mapping[str, Any] = field(default_factory=dict)
    note: Callable[[str], None] = lambda note: None  # called with what was unusual, in one line


def train(
    module: nn.Module,
    loss: Loss,
    *,
    name: str,
    n_steps: int,
    learning_rate: float,
    weight_decay: float,
    seed: int,
    configuration: Mapping[str, Any],
    schedule: str = "cosine",
    context: TrainingContext | None = None,
    prepare: Prepare | None = None,
) -> float:
    """Train `module` in place with AdamW (Adam where `weight_decay` is 0).

    The module ends on the CPU, in eval mode.

    Parameters
    ----------
    loss : a scalar, given the step's random generator, or what `prepare` returns for it, and the module's
        device. With several processes, it is of the rows of `processes.own_rows`, or uses outputs for all
        rows by `processes.gathered`
    schedule : of the learning rate, "cosine" after a warm-up, or "constant"
    prepare : the batch of a step, which is made in another thread during the step before it
    configuration : JSON values. A checkpoint is continued if it has these and the context's `content`

    Returns the mean loss since the last report, or nan if the checkpoint was already complete.

    Raises
    ------
    ChoreographError   the loss is not finite, or a checkpoint cannot be written
    ParameterError     unknown device
    KeyboardInterrupt  Ctrl-C: the step was completed and a checkpoint written
    """
    context = context or TrainingContext()
    device = select_device(context.device)
    call_elsewhere(
        train, module, loss, name=name, n_steps=n_steps, learning_rate=learning_rate,
        weight_decay=weight_decay, seed=seed, configuration=configuration, schedule=schedule,
        context=TrainingContext(device=context.device, precision=context.precision), prepare=prepare,
    )  # fmt: skip
    module.to(device).train()
    optimizer = torch.optim.AdamW(module.parameters(), weight_decay=weight_decay)
    # The round trip through JSON turns tuples into lists, as in the checkpoint.
    expected = json.loads(json.dumps({**context.content, **configuration, "seed": seed, "steps": n_steps}))
    run = _Run(name, n_steps, module, optimizer, expected, context)
    run.restore_or_start()
    own_seed = seed * _SEED_STRIDE + process_index() * _PROCESS_STRIDE
    with (
        forked_rng(),
        shared_batch_norms(module),
        _batches(prepare, seed, n_steps) as batch_of,
        _defer_interrupts() as interrupted,
    ):
        try:
            while run.step < n_steps:
                _seed_torch((own_seed + run.step) % 2**63, device)
                with torch.autocast(device.type, torch.bfloat16, enabled=context.precision == "bfloat16"):
                    value = loss(batch_of(run.step), device)
                optimizer.zero_grad()
                torch.autograd.backward(value)
                average_gradients(module)
                factor = 1.0 if schedule == "constant" else _cosine_factor(run.step, n_steps)
                optimizer.param_groups[0]["lr"] = learning_rate * factor
                optimizer.step()
                mean, is_interrupted = agreed(float(value.detach()), interrupted())
                run.advance(mean)
                if is_interrupted:
                    raise _Interrupted
        except _Interrupted:
            run.save()
            raise KeyboardInterrupt from None
    module.to("cpu").eval()
    return run.loss


@contextmanager
def _batches(prepare: Prepare | None, seed: int, n_steps: int) -> Iterator[Callable[[int], Any]]:
    """What the loss of each step is given: its random generator, or the batch that is prepared with it."""

    def rng_of(step: int) -> np.random.Generator:
        return np.random.default_rng([seed, step])

    if prepare is None:
        yield rng_of
        return
    coming: dict[int, Future[Any]] = {}
    with ThreadPoolExecutor(1) as pool:

        def batch_of(step: int) -> Any:
            ready = coming.pop(step, None) or pool.submit(prepare, rng_of(step))
            if step + 1 < n_steps:
                coming[step + 1] = pool.submit(prepare, rng_of(step + 1))
            return ready.result()

        yield batch_of


def _seed_torch(seed: int, device: torch.device) -> None:
    """Seed the generators of a step. Without CUDA, `torch.manual_seed` formats a traceback at each call."""
    torch.default_generator.manual_seed(seed)
    if device.type == "cuda":
        torch.cuda.manual_seed_all(seed)


def steps_of_epochs(epochs: int, n_examples: float, batch_size: int) -> int:
    """Number of steps of `epochs` passes over the examples."""
    return epochs * max(1, math.ceil(n_examples / batch_size))


def select_device(device: str) -> torch.device:
    """The torch device of `auto` (a GPU if there is one), `cpu` or `cuda`."""
    check_choice("a device", device, DEVICES)
    if device == "cuda" and not torch.cuda.is_available():
        raise ParameterError("expected a CUDA device, found none: use --device cpu or auto")
    return torch.device(
        "cuda" if device == "auto" and torch.cuda.is_available() else device.replace("auto", "cpu")
    )


def forked_rng() -> AbstractContextManager[None]:
    """A block after which torch's generators of the CPU and of this process's GPU are as they were before.

    Without a choice of GPUs, torch would use memory on each of them, from every process.
    """
    return torch.random.fork_rng([torch.cuda.current_device()] if torch.cuda.is_available() else [])


def load_pretrained(module: nn.Module, name: str, weights: Mapping[str, NDArray[Any]]) -> None:
    """Load the weights of another repertoire's network. Raises `ParameterError` if they do not fit."""
    try:
        module.load_state_dict({key: torch.from_numpy(np.array(value)) for key, value in weights.items()})
    except RuntimeError as error:
        raise ParameterError(
            f"expected {name} weights of the chosen preset, got others: the repertoire of the pretrained "
            "weights was built with another preset or other settings"
        ) from error


def _cosine_factor(step: int, n_steps: int) -> float:
    """Linear warm-up over a tenth of the steps, then half a cosine down to zero."""
    warm = max(1, n_steps // 10)
    if step < warm:
        return (step + 1) / (warm + 1)
    return 0.5 + 0.5 * float(np.cos(np.pi * (step - warm) / max(1, n_steps - warm)))


def read_checkpoint(path: Path) -> dict[str, Any]:
    """The content of a checkpoint, read without executing code. Raises one of `_UNREADABLE` if damaged."""
    with zipfile.ZipFile(path) as archive:  # torch's container: its checksums show damage
        damaged = archive.testzip()
        if damaged is not None:
            raise zipfile.BadZipFile(damaged)
    stored = torch.load(path, weights_only=True, map_location="cpu")
    if not isinstance(stored, dict):
        raise TypeError(type(stored).__name__)
    return stored


class _Interrupted(Exception):
    """Ctrl-C was pressed during the step just completed."""


@contextmanager
def _defer_interrupts() -> Iterator[Callable[[], bool]]:
    """Defer Ctrl-C until the step is complete: weights of half a step could not be resumed exactly."""
    pressed: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False  # only the main thread receives signals
        return
    before = signal.signal(signal.SIGINT, lambda number, frame: pressed.append(number))
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, before)


class _Run:
    """The state of one training, written to and restored from its folder."""

    def __init__(
        self,
        name: str,
        n_steps: int,
        module: nn.Module,
        optimizer: torch.optim.Optimizer,
        configuration: Mapping[str, Any],
        context: TrainingContext,
    ) -> None:
        self.name, self.n_steps, self.context, self.configuration = name, n_steps, context, configuration
        self.parts: dict[str, Any] = {"module": module, "optimizer": optimizer}
        self.step = 0
        self.loss = float("nan")
        self._recent: list[float] = []
        self._log_every = max(1, n_steps // LOG_LINES)
        self._first_step = 0
        folder = context.folder
        self.checkpoint = folder / f"{name}.pt" if folder is not None else None
        self.log = folder / f"{name}.jsonl" if folder is not None else None
        self._start_time = self._saved_time = time.monotonic()

    def restore_or_start(self) -> None:
        """Restore the checkpoint if there is one and `resume` is set. Otherwise start an empty log.

        Other processes take the state of the first one.
        """
        self._restore_or_start()
        state = from_first(self._state)
        if state is not None:
            self._load(torch.load(io.BytesIO(state), weights_only=True, map_location="cpu"))

    def _restore_or_start(self) -> None:
        if self.checkpoint is None or self.log is None:
            return
        with writing(self.checkpoint):
            self.checkpoint.parent.mkdir(parents=True, exist_ok=True)
        if self.context.resume and self.checkpoint.exists():
            why_not = self._restored_unless()
            if not why_not:
                return
            self.context.note(f"{self.checkpoint.name}: training of {self.name} starts again: {why_not}")
        with writing(self.log):
            self.log.write_text("", encoding="utf-8")

    def _restored_unless(self) -> str:
        """Restore the checkpoint and return "", or change nothing and return why it cannot be continued."""
        assert self.checkpoint is not None
        initial = copy.deepcopy({key: part.state_dict() for key, part in self.parts.items()})
        try:
            stored = read_checkpoint(self.checkpoint)
            change = self._change_since(json.loads(stored["configuration"]))
            if change:
                return change
            self._load(stored)
        except _UNREADABLE:
            for key, part in self.parts.items():
                part.load_state_dict(initial[key])
            return "the checkpoint is damaged"
        return ""

    def _load(self, stored: Mapping[str, Any]) -> None:
        for key, part in self.parts.items():
            part.load_state_dict(stored[key])
        step = int(stored["step"])
        if not 0 <= step <= self.n_steps:
            raise ValueError(f"step {step} of {self.n_steps}")
        self.step = self._first_step = step

    def _change_since(self, stored: Mapping[str, Any]) -> str:
        """The difference to the configuration of a checkpoint, or empty if there is none."""
        expected = self.configuration
        changed = sorted(key for key in {*stored, *expected} if stored.get(key) != expected.get(key))
        if not changed:
            return ""
        key, more = changed[0], f", and {len(changed) - 1} more" if len(changed) > 1 else ""
        before, now = _shortened(stored.get(key)), _shortened(expected.get(key))
        return f"the checkpoint was of {key} = {before}, now it is {now}{more}"

    def advance(self, loss: float) -> None:
        """Count a completed step, and log, report and save when due."""
        self.step += 1
        if not np.isfinite(loss):
            raise ChoreographError(
                f"training of {self.name} failed at step {self.step}: expected a finite loss, got {loss}: "
                "the learning rate is too high, or a take is damaged"
            )
        self._recent.append(loss)
        last = self.step == self.n_steps
        if last or self.step % self._log_every == 0:
            self._log_progress()
        if last or time.monotonic() - self._saved_time > CHECKPOINT_EVERY_S:
            self.save()

    def _log_progress(self) -> None:
        self.loss = float(np.mean(self._recent))
        self._recent.clear()
        seconds = time.monotonic() - self._start_time
        left = seconds / (self.step - self._first_step) * (self.n_steps - self.step)
        if self.log is not None:
            line = {"name": self.name, "step": self.step, "loss": self.loss, "seconds": round(seconds, 3)}
            with writing(self.log), self.log.open("a", encoding="utf-8") as log:
                log.write(json.dumps(line) + "\n")
        self.context.report(TrainingProgress(self.name, self.step, self.n_steps, self.loss, left))

    def save(self) -> None:
        """Write the checkpoint atomically."""
        if self.checkpoint is None:
            return
        state = self._state()
        with atomic_path(self.checkpoint) as temporary:
            temporary.write_bytes(state)
        self._saved_time = time.monotonic()

    def _state(self) -> bytes:
        state = {key: part.state_dict() for key, part in self.parts.items()}
        state |= {"step": self.step, "configuration": json.dumps(self.configuration)}
        content = io.BytesIO()
        torch.save(state, content)
        return content.getvalue()


def _shortened(value: Any) -> str:
    text = "nothing" if value is None else json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."
