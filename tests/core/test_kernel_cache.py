"""Compiled kernels between runs: processes together, damaged and missing entries, nowhere to write."""

import os
import random
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from choreograph.core import kernel_cache

# A kernel compiled at its first call, and two whose wrappers call them by a name that one process gave them.
# The wrapper of the last one is made at its first call.
_KERNELS = """
import numba
import numpy as np
from choreograph.core.kernel_cache import njit

@njit(nogil=True)
def doubled(x):
    return x * 2.0

@numba.guvectorize(["void(float32[:], float32[:])", "void(float64[:], float64[:])"],
                   "(n)->(n)", cache=True)
def summed(x, y):
    total = 0.0
    for i in range(len(x)):
        total += x[i]
        y[i] = total

@numba.guvectorize("(n)->(n)", cache=True)
def halved(x, y):
    for i in range(len(x)):
        y[i] = x[i] / 2.0
"""
_USE = """
import logging
logging.basicConfig(format="note: %(message)s")
import kernels
import numpy as np
assert kernels.doubled(np.arange(3.0)).tolist() == [0.0, 2.0, 4.0]
assert kernels.summed(np.arange(4.0)).tolist() == [0.0, 1.0, 3.0, 6.0]
assert kernels.summed(np.arange(4, dtype=np.float32)).tolist() == [0.0, 1.0, 3.0, 6.0]
halves = np.empty(3)
kernels.halved(np.arange(3.0), halves)
assert halves.tolist() == [0.0, 0.5, 1.0]
print(sum(kernels.doubled.stats.cache_hits.values()), "hits")
"""


@pytest.fixture
def start(tmp_path):
    """Starts a process that uses the kernels, with a cache folder of its own, changed as given."""
    (tmp_path / "kernels.py").write_text(_KERNELS)

    def start(code=_USE, **environment):
        env = {
            **os.environ,
            "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
            "PYTHONPATH": str(tmp_path),
            **environment,
        }
        env = {key: value for key, value in env.items() if value is not None}
        return subprocess.Popen(
            [sys.executable, "-c", code], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    return start


def _entries(folder: Path) -> list[Path]:
    return sorted(p for p in folder.rglob("*") if p.is_file() and p.suffix != ".lock")


def _finished(process) -> tuple[str, str]:
    """What a process said on stdout and stderr; it must not have failed."""
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return out, err


def test_what_one_process_compiled_the_next_ones_read(start, tmp_path):
    out, err = _finished(start())
    assert (out, err) == ("0 hits\n", "")
    kept = {path: path.read_bytes() for path in _entries(tmp_path / "cache")}
    assert len(kept) == 7  # the first, and of three signatures the function and its wrapper
    assert not list(tmp_path.rglob("*.nb?"))  # nor numba's own, whenever the wrapper was made
    assert _finished(start()) == ("1 hits\n", "")
    assert {path: path.read_bytes() for path in _entries(tmp_path / "cache")} == kept


def test_processes_started_together_compile_each_kernel_once(start, tmp_path):
    together = [start() for _ in range(4)]
    hits = sorted(_finished(process)[0] for process in together)
    assert hits == ["0 hits\n", "1 hits\n", "1 hits\n", "1 hits\n"]
    assert len(_entries(tmp_path / "cache")) == 7


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked on POSIX")
def test_a_fork_compiles_what_its_parent_has_not(start):
    code = (
        "import os, kernels\n"
        "import numpy as np\n"
        "kernels.doubled(1.0)\n"
        "child = os.fork()\n"
        "if not child:\n"
        "    os._exit(int(kernels.doubled(np.arange(3.0)).sum() != 6.0))\n"
        "assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0\n"
    )
    assert _finished(start(code)) == ("", "")


def test_any_damage_is_noticed_and_mended(start, tmp_path):
    _finished(start())
    rng = random.Random(3)
    for kind, path in enumerate(_entries(tmp_path / "cache")):
        garbled = bytearray(path.read_bytes())
        garbled[rng.randrange(len(garbled))] ^= 1 << rng.randrange(8)
        path.write_bytes((garbled, garbled[: len(garbled) // 2], b"")[kind % 3])
    out, err = _finished(start())
    assert out == "0 hits\n"
    assert err.startswith("note: compiled code in ") and err.count("\n") == 1, err
    assert _finished(start()) == ("1 hits\n", "")


@pytest.mark.parametrize("removed", [5, 6])
def test_a_wrapper_calls_no_function_that_was_compiled_again(start, tmp_path, removed):
    _finished(start())
    function = _entries(tmp_path / "cache")[removed]
    assert function.name.startswith("kernels.summed")
    function.unlink()
    assert _finished(start())[1] == ""


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders of other users are told on POSIX")
def test_without_a_home_kernels_are_kept_in_the_temporary_folder(start, tmp_path):
    blocked = tmp_path / "a file"
    blocked.touch()
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    own = dict.fromkeys(("NUMBA_CACHE_DIR", "CHOREOGRAPH_CACHE", "XDG_CACHE_HOME"))
    nowhere = {**own, "HOME": str(blocked)}
    out, err = _finished(start(**nowhere, TMPDIR=str(temporary)))
    assert out == "0 hits\n"
    assert err.startswith("note: compiled code is kept in ") and err.count("\n") == 1, err
    assert len(_entries(temporary)) == 7
    assert _finished(start(**nowhere, TMPDIR=str(temporary)))[0] == "1 hits\n"
    # Code that others could have written is not run.
    if os.getuid() == 0:
        os.chown(temporary / f"choreograph-{os.getuid()}", 12345, 12345)
        out, err = _finished(start(**nowhere, TMPDIR=str(temporary)))
        assert out == "0 hits\n"
        assert err.startswith("note: compiled code is not kept") and err.count("\n") == 1, err


def test_where_nothing_can_be_written_kernels_are_compiled_every_time(start, tmp_path):
    blocked = tmp_path / "a file"
    blocked.touch()
    everywhere = (
        "import tempfile\n"
        "def nowhere(): raise FileNotFoundError('no usable temporary directory')\n"
        "tempfile.gettempdir = nowhere\n"
    )
    for _ in range(2):
        out, err = _finished(start(everywhere + _USE, NUMBA_CACHE_DIR=str(blocked)))
        assert out == "0 hits\n"
        assert err.startswith("note: compiled code is not kept") and err.count("\n") == 1, err


def test_kernels_are_compiled_ahead_for_the_signature_of_their_calls(start, tmp_path):
    (tmp_path / "planned").mkdir()
    (tmp_path / "planned" / "sums.py").write_text(
        "from choreograph.core.kernel_cache import njit\n"
        "@njit('float64(float64[::1])', nogil=True)\n"
        "def total(x):\n"
        "    return x.sum()\n"
        "@njit(nogil=True)\n"
        "def other(x):\n"
        "    return x\n"
    )
    code = (
        "import time\n"
        "import numpy as np\n"
        "from choreograph.core.kernel_cache import compiled_ahead\n"
        "from planned import sums\n"
        "with compiled_ahead('plan', 'planned.su'):\n"  # beginnings of names
        "    time.sleep(0.1)\n"
        "assert not sums.total.signatures\n"
        "with compiled_ahead('planned'):\n"
        "    while not sums.total.signatures:\n"
        "        time.sleep(0.01)\n"
        "compiled = list(sums.total.signatures)\n"
        "assert sums.total(np.arange(4.0)) == 6.0\n"
        "assert sums.total.signatures == compiled and not sums.other.signatures\n"
        "assert list(sums.total.stats.cache_hits.values()) == [1]  # compiled by another process\n"
    )
    assert _finished(start(code)) == ("", "")
    assert len(_entries(tmp_path / "cache")) == 1


def test_a_block_that_fails_waits_only_for_the_kernel_that_is_compiled(monkeypatch):
    begun, may_end, compiled = threading.Event(), threading.Event(), []

    class Kernel:
        __module__ = "planned"

        def compile(self, signature):
            begun.set()
            assert may_end.wait(10)
            compiled.append(signature)

    monkeypatch.setattr(kernel_cache, "_ahead", {Kernel(): "void()", Kernel(): "void(int64)"})
    monkeypatch.setattr(kernel_cache, "_compiling_processes", lambda kernels: [])

    def fail():
        assert begun.wait(10)
        threading.Timer(0.05, may_end.set).start()
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), kernel_cache.compiled_ahead("planned"):
        fail()
    assert len(compiled) == 1
    assert not [thread for thread in threading.enumerate() if thread.name == "compiled_ahead"]


@pytest.mark.slow
def test_nothing_is_compiled_into_numbas_own_cache():
    """Songs are tracked, counted and divided by both trackers; numba's cache prints what it reads and writes.

    In the folder that the tests share: what they have compiled before is read from there.
    """
    code = (
        "import numpy as np\n"
        "from choreograph.core import kernel_cache\n"
        "from choreograph.music.bars import track_bars\n"
        "from choreograph.music.mel import log_mel\n"
        "from choreograph.music.beats import librosa_beats\n"
        "from choreograph.music.form import song_sections\n"
        "from choreograph.music.spectral import spectral_features\n"
        "clicks = np.zeros(22050 * 12, np.float32)\n"
        "clicks[::11025] = 1.0\n"
        "mel = log_mel(clicks)\n"
        "beats = librosa_beats(mel, 12.0)\n"
        "track_bars(clicks, mel, beats)\n"
        "song_sections(spectral_features(clicks, beats), beats)\n"
        "print(kernel_cache._folder())\n"
    )
    env = {**os.environ, "NUMBA_DEBUG_CACHE": "1"}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert "[cache]" not in done.stdout
    folder = Path(done.stdout.strip())
    assert not list(folder.rglob("*.nb?"))
    modules = {path.name.split(".")[0] for path in _entries(folder)}
    assert modules >= {"beat", "guf-beat", "utils", "guf-utils"}  # of librosa's beat tracker
