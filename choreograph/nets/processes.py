"""Training in several processes of `torchrun`, which share the rows of every batch.

The first process reads, measures and writes. The others only help it to train: `training.train` sends them
the network, the loss and its data. A step draws the same batch in every process. Each process computes its
own rows, and the gradients are averaged. Terms that compare rows, such as contrast, use the outputs for all
rows (`gathered`), and so do batch normalisations. So the gradient of a step is that of one process, up to
rounding and dropout, and a checkpoint does not depend on the number of processes.

Without `torchrun`, there is one process, and these functions change nothing.
"""

from __future__ import annotations

import os
import pickle
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields
from datetime import timedelta
from functools import partial
from typing import Any, TypeVar

import torch
from torch import Tensor, distributed, nn
from torch.nn.modules.batchnorm import _BatchNorm

from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.numerics import default_numerics
from choreograph.core.workers import is_of_torchrun, pickled

# The processes, and what the first one sends to the others.


_LONGEST_WAIT = timedelta(days=365)  # of the other processes, while the first one reads takes
_CPU = torch.device("cpu")

_Batch = TypeVar("_Batch", bound=Any)  # a tensor, or a dataclass of tensors


@contextmanager
def joined() -> Iterator[bool]:
    """Join the processes that `torchrun` started. Yields True in the first process.

    The other processes help to train until the first one leaves its block. Only then do they enter theirs,
    with False. An exception that leaves the block must end the first process. The others notice that and
    enter their blocks.

    Raises `ParameterError` if this machine has GPUs, but fewer than processes.
    """
    if not is_of_torchrun():
        yield True
        return
    backend = "gloo"
    if torch.cuda.is_available():
        _select_gpu(int(os.environ["LOCAL_RANK"]), int(os.environ["LOCAL_WORLD_SIZE"]))
        backend = "cpu:gloo,cuda:nccl"
    distributed.init_process_group(backend, timeout=_LONGEST_WAIT)
    try:
        if process_index() > 0:
            _help()
            yield False
        else:
            yield True
            _broadcast(None)  # no more work
    finally:
        # Also after an error, or the threads of the group may abort the process at its end.
        distributed.destroy_process_group()


def _select_gpu(index: int, n: int) -> None:
    if n > torch.cuda.device_count():
        raise ParameterError(
            f"expected a GPU for each of {n} processes on this machine, got {torch.cuda.device_count()}: "
            "start fewer with --nproc-per-node, or set CUDA_VISIBLE_DEVICES= to train on the CPU"
        )
    torch.cuda.set_device(index)


def n_processes() -> int:
    """The number of processes that train together."""
    return distributed.get_world_size() if distributed.is_initialized() else 1


def process_index() -> int:
    """The number of this process among them, 0 for the first one."""
    return distributed.get_rank() if distributed.is_initialized() else 0


@default_numerics()
def _help() -> None:
    """Do the work that the first process sends, until there is no more, or it has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process decides what Ctrl-C ends
    with suppress(_LostProcessError):
        while (work := _broadcast(None)) is not None:
            function, arguments, named = pickle.loads(work)
            try:
                function(*arguments, **named)
            except _LostProcessError:
                raise
            except (ChoreographError, KeyboardInterrupt):
                continue  # all processes have it, and the first one says so


def call_elsewhere(function: Callable[..., object], *arguments: Any, **named: Any) -> None:
    """From the first process, call a function in all others, with copies of the arguments."""
    if distributed.is_initialized() and process_index() == 0:
        _broadcast(pickled((function, arguments, named)))


def from_first(content: Callable[[], bytes]) -> bytes | None:
    """In each other process, what `content` returns in the first one, else None."""
    if not distributed.is_initialized():
        return None
    is_first = process_index() == 0
    sent = _broadcast(content() if is_first else None)
    return None if is_first else sent


def _broadcast(content: bytes | None) -> bytes | None:
    """The `content` of the first process."""
    held = [content]
    with _connected():
        distributed.broadcast_object_list(held, src=0, device=_CPU)
    return held[0]


class _LostProcessError(ChoreographError):
    """Another process has ended."""


@contextmanager
def _connected() -> Iterator[None]:
    try:
        yield
    except torch.OutOfMemoryError:
        raise
    except RuntimeError as error:
        reason = " ".join(str(error).split())[:120]
        raise _LostProcessError(
            f"expected {n_processes()} processes to train, lost one ({reason}): its own error says why, or "
            "it was killed, such as for lack of memory"
        ) from error


# The share of a process in a batch, and results of all processes.


def own_rows(batch: _Batch) -> _Batch:
    """The rows of a batch, a tensor or a dataclass of tensors, that this process computes.

    Raises `ParameterError` if the processes cannot have equally many rows.
    """
    if not distributed.is_initialized():
        return batch
    rows: Any = batch
    if isinstance(rows, Tensor):
        rows = rows[own_part(len(rows))]
    else:
        rows = type(rows)(*(own_rows(getattr(rows, field.name)) for field in fields(rows)))
    result: _Batch = rows
    return result


def own_part(n_rows: int) -> slice:
    """Which of `n_rows` rows this process computes. Raises `ParameterError` as `own_rows`."""
    n = n_processes()
    if n_rows % n:
        raise ParameterError(
            f"expected a number of processes that divides a batch of {n_rows} samples, got {n}: change "
            "--nproc-per-node"
        )
    size = n_rows // n
    return slice(process_index() * size, (process_index() + 1) * size)


def gathered(rows: Tensor) -> Tensor:
    """The rows of all processes, in their order. Gradients reach the process that computed a row."""
    if not distributed.is_initialized():
        return rows
    result: Tensor = _Gathered.apply(rows)  # type: ignore[no-untyped-call]
    return result


class _Gathered(torch.autograd.Function):
    """Rows (B, ...) of each of P processes to (P B, ...).

    Every process computes a loss with all rows. The gradient of its own rows is the sum over these losses.
    Averaging the gradients of weights (`average_gradients`) divides it by P.
    """

    @staticmethod
    def forward(ctx: Any, rows: Tensor) -> Tensor:
        parts = [torch.empty_like(rows) for _ in range(n_processes())]
        with _connected():
            distributed.all_gather(parts, rows.contiguous())
        return torch.cat(parts)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> Tensor:
        total = gradient.to(torch.float32, copy=True).contiguous()
        with _connected():
            distributed.all_reduce(total)
        return total[own_part(len(total))].to(gradient.dtype)


def average_gradients(module: nn.Module) -> None:
    """Replace the gradients of the weights by their means over the processes."""
    if not distributed.is_initialized():
        return
    gradients = [weight.grad for weight in module.parameters() if weight.grad is not None]
    mean = torch.cat([gradient.flatten() for gradient in gradients])
    with _connected():
        distributed.all_reduce(mean)
    mean /= n_processes()
    parts = torch.split(mean, [gradient.numel() for gradient in gradients])
    for gradient, part in zip(gradients, parts, strict=True):
        gradient.copy_(part.view_as(gradient))


def agreed(loss: float, stop: bool) -> tuple[float, bool]:
    """The mean of the losses of the processes, and whether any of them is to stop."""
    if not distributed.is_initialized():
        return loss, stop
    both = torch.tensor([loss, float(stop)], dtype=torch.float64)
    with _connected():
        distributed.all_reduce(both)
    return float(both[0]) / n_processes(), bool(both[1] > 0)


# Batch normalisation over the rows of all processes.


@contextmanager
def shared_batch_norms(module: nn.Module) -> Iterator[None]:
    """Inside, the batch normalisations of a network in training use the statistics of all processes.

    `torch.nn.SyncBatchNorm` does this on GPUs alone.
    """
    norms = [part for part in module.modules() if isinstance(part, _BatchNorm)]
    if not distributed.is_initialized():
        norms = []
    for norm in norms:
        norm.forward = partial(_normalised, norm)  # type: ignore[method-assign]
    try:
        yield
    finally:
        for norm in norms:
            del norm.forward


def _normalised(norm: _BatchNorm, values: Tensor) -> Tensor:
    """Values (B, C, ...) with the mean and the variance of each channel over all rows, and the others' rows.

    Every process has equally many values.
    """
    over = [dim for dim in range(values.ndim) if dim != 1]
    wide = values.float()
    own = torch.stack([wide.mean(over), wide.var(over, unbiased=False)])  # (2, C)
    means, variances = gathered(own[None]).unbind(1)  # (P, C) each
    mean = means.mean(dim=0)
    variance = (variances + (means - mean).square()).mean(dim=0)
    n = values.numel() // values.shape[1] * len(means)
    counted, momentum = norm.num_batches_tracked, norm.momentum
    assert norm.running_mean is not None and norm.running_var is not None
    assert counted is not None and momentum is not None
    with torch.no_grad():  # as torch does, for later inference
        counted.add_(1)
        norm.running_mean.lerp_(mean, momentum)
        norm.running_var.lerp_(variance * n / (n - 1), momentum)
    shape = (1, -1, *(1,) * (values.ndim - 2))
    scale = norm.weight * torch.rsqrt(variance + norm.eps)
    return ((wide - mean.view(shape)) * scale.view(shape) + norm.bias.view(shape)).to(values.dtype)
