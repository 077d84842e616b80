"""The settings of NumPy and torch: the default ones in our functions, the caller's around them.

Both libraries keep settings for a whole process or thread, and programs that use us change them. Results do
not depend on them, and they are the same afterwards. Random numbers are drawn from generators of our own; of
torch's, which is global, the state is forked.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
from threadpoolctl import threadpool_limits


@contextmanager
def default_numerics() -> Iterator[None]:
    """NumPy and torch have their default settings in the block; decorates functions, too.

    These are what NumPy does about errors of floating-point numbers, and torch's default type and device, its
    precision of products, autocast, and whether gradients are recorded. Torch is not imported for it.
    """
    with ExitStack() as stack:
        stack.enter_context(np.errstate(divide="warn", over="warn", under="ignore", invalid="warn"))
        if "torch" in sys.modules:
            stack.enter_context(_default_torch())
        yield


@contextmanager
def _default_torch() -> Iterator[None]:
    import torch

    dtype, precision = torch.get_default_dtype(), torch.get_float32_matmul_precision()
    with ExitStack() as stack:
        # Those of the whole process are changed only where they differ, for the sake of other threads.
        if dtype != torch.float32:
            stack.callback(torch.set_default_dtype, dtype)
            torch.set_default_dtype(torch.float32)
        if precision != "highest":
            stack.callback(torch.set_float32_matmul_precision, precision)
            torch.set_float32_matmul_precision("highest")
        if torch.get_default_device().type != "cpu":
            stack.enter_context(torch.device("cpu"))
        if torch.is_autocast_enabled("cpu"):
            stack.enter_context(torch.autocast("cpu", enabled=False))
        stack.enter_context(torch.inference_mode(False))
        stack.enter_context(torch.enable_grad())
        yield


@contextmanager
def one_thread() -> Iterator[None]:
    """As `default_numerics`, and BLAS and torch use one thread: sums have one order on any number of cores.

    A dance gains nothing from more: its arrays are small, and the planner has threads of its own.
    """
    import torch  # a second to import

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1, user_api="blas"), default_numerics():
            yield
    finally:
        torch.set_num_threads(before)
