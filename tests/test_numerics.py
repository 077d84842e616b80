"""Results do not depend on the settings of NumPy and torch, and leave them as they are."""

from __future__ import annotations

import random
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
import torch
from threadpoolctl import threadpool_info, threadpool_limits

import choreograph as cg
from choreograph.evaluation.metrics import beat


def settings() -> dict[str, object]:
    """All that is global."""
    return {
        "torch's generator": torch.get_rng_state().tolist(),
        "NumPy's generator": repr(np.random.get_state()),  # noqa: NPY002
        "Python's generator": random.getstate(),
        "type": torch.get_default_dtype(),
        "device": torch.get_default_device(),
        "precision of products": torch.get_float32_matmul_precision(),
        "gradients": (torch.is_grad_enabled(), torch.is_inference_mode_enabled()),
        "autocast": torch.is_autocast_enabled("cpu"),
        "deterministic": torch.are_deterministic_algorithms_enabled(),
        "threads of torch": torch.get_num_threads(),
        "threads of BLAS": {i["filepath"]: i["num_threads"] for i in threadpool_info()},
        "errors of NumPy": np.geterr(),
        "warnings": list(warnings.filters),
    }


@contextmanager
def unusual_settings(threads: int = 3) -> Iterator[None]:
    n_threads = torch.get_num_threads()
    try:
        torch.set_default_dtype(torch.float64)
        torch.set_default_device("meta")
        torch.set_float32_matmul_precision("medium")
        torch.use_deterministic_algorithms(True)
        torch.set_num_threads(threads)
        with (
            torch.inference_mode(), torch.autocast("cpu", dtype=torch.bfloat16), threadpool_limits(threads),
            np.errstate(all="raise"), warnings.catch_warnings(),
        ):  # fmt: skip
            warnings.simplefilter("error")
            yield
    finally:
        torch.set_default_dtype(torch.float32)
        torch.set_default_device(None)
        torch.set_float32_matmul_precision("highest")
        torch.use_deterministic_algorithms(False)
        torch.set_num_threads(n_threads)


@pytest.fixture(scope="module")
def house():
    return cg.load_song(cg.example_songs()["house"], duration_s=8.0)


@pytest.mark.parametrize("engine", ["graph", "mixer", "rollout"])
def test_a_dance_is_the_same_under_unusual_settings_and_leaves_them(house, engine):
    usual = cg.dance(house, engine=engine, cache=False)
    with unusual_settings():
        before = settings()
        unusual = cg.dance(house, engine=engine, cache=False)
        after = settings()
    assert [name for name in before if before[name] != after[name]] == []
    assert unusual.motion.root_pos_m.tobytes() == usual.motion.root_pos_m.tobytes()
    assert unusual.motion.local_quat.tobytes() == usual.motion.local_quat.tobytes()
    assert unusual.plan.to_json() == usual.plan.to_json() and unusual.notes == usual.notes


def test_usual_settings_are_left_too(house):
    cg.dance(house, cache=False)  # loads libraries
    before = settings()
    cg.dance(house)
    assert settings() == before


def test_songs_streams_and_files_are_the_same_under_unusual_settings(house, made, tmp_path):
    def results(folder) -> list[bytes]:
        folder.mkdir()
        for suffix in ("glb", "bvh", "npz"):
            made.save(folder / f"a.{suffix}")
        stream = cg.RolloutStream(house)
        frames = [next(iter(stream)).local_quat for _ in range(30)]
        loaded = cg.load_song(cg.example_songs()["waltz"], duration_s=2.0).samples
        alike = beat.evaluate(np.arange(9.0), np.arange(9.0) + 0.2)
        files = [path.read_bytes() for path in sorted(folder.iterdir())]
        return [*files, np.stack(frames).tobytes(), loaded.tobytes(), repr(alike).encode()]

    with threadpool_limits(1):  # threads of a stream are the caller's
        usual = results(tmp_path / "usual")
    with unusual_settings(threads=1):
        before = settings()
        assert results(tmp_path / "unusual") == usual
        assert settings() == before
