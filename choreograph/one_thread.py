"""Linear algebra and networks on one thread: sums are taken in the same order on any number of cores."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_thread() -> Iterator[None]:
    """BLAS and torch use one thread in the block, and as many as before after it; decorates functions, too.

    A dance gains nothing from more: its arrays are small, and the planner has threads of its own.
    """
    import torch  # a second to import

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1, user_api="blas"):
            yield
    finally:
        torch.set_num_threads(before)
