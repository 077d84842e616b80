"""What every test may ask for."""

from __future__ import annotations

import functools
import gc
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from filelock import FileLock
from hypothesis import settings

# Tests run in several processes: one thread each, or they fight for the cores. All share the kernels that one
# of them compiled, and the analyses of songs. Set before anything imports numpy.
if "PYTEST_XDIST_WORKER" in os.environ:
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(threads, "1")
_CACHE = Path(__file__).resolve().parents[1] / ".pytest_cache"
os.environ.setdefault("NUMBA_CACHE_DIR", str(_CACHE / "numba"))
os.environ.setdefault("CHOREOGRAPH_CACHE", str(_CACHE / "choreograph"))

# Property tests check what a law says, not how long it takes on a loaded machine.
settings.register_profile("choreograph", deadline=None)
settings.load_profile("choreograph")


ALONE_FOLDER = "view"  # all tests marked `alone` are here: `make test` collects no others for them


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Without the garbage collector, whose passes would take a third of the time.

    What the tests have imported stays until the end: later passes leave it out.
    """
    _build_in_one_process()
    _open_built_in_repertoire_once()
    _keep_no_results()
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def _build_in_one_process() -> None:
    """Builds start no processes unless told to, since trainings are shortened in this one only."""
    from choreograph.core import workers

    workers.n_cores = lambda: 1


def _keep_no_results() -> None:
    """Builds measure all takes unless told to: tests change functions, of which keys have only the names."""
    from choreograph.core import cache

    cache.results_cache = lambda max_bytes: cache.DiskCache(None, max_bytes)


def _open_built_in_repertoire_once() -> None:
    """Let all tests of a process read one built-in repertoire, with all that it has computed of its clips."""
    from choreograph.library import repertoire

    open_anew = repertoire.starter_repertoire
    opened = functools.cache(lambda path: open_anew())

    @functools.wraps(open_anew)
    def starter_repertoire():
        return opened(repertoire.STARTER_PATH)

    repertoire.starter_repertoire = starter_repertoire


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with the most slow tests come first, so that no worker is left with a long file at the end."""
    elsewhere = [i for i in items if i.get_closest_marker("alone") and i.path.parent.name != ALONE_FOLDER]
    if elsewhere:
        raise pytest.UsageError(f"expected tests marked alone in tests/{ALONE_FOLDER}, got {elsewhere}")
    n_slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: -n_slow[item.path])


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real data beside the checkout; tests that need it skip where it is absent."""
    data = Path(__file__).resolve().parents[1].parent / "shared" / "data"
    if not data.is_dir():
        pytest.skip(f"no real data at {data}")
    return data


@pytest.fixture(scope="session")
def repertoire(tmp_path_factory):
    """A small repertoire without networks, from synthetic takes."""
    from synthetic_repertoire import synthetic_repertoire

    return synthetic_repertoire(tmp_path_factory.mktemp("synthetic") / "rep.h5")


@pytest.fixture(scope="session")
def song(tmp_path_factory):
    """A song of clicks, 12.4 s at 120 BPM."""
    from synthetic_repertoire import write_clicks

    return write_clicks(tmp_path_factory.mktemp("songs") / "clicks.wav", duration_s=12.4)


@pytest.fixture(scope="session")
def made(repertoire, song):
    """A dance of the default engine."""
    import choreograph as cg

    return cg.dance(song, repertoire)


@pytest.fixture(scope="session")
def made_once(tmp_path_factory) -> Callable[[str, Callable[[Path], object]], Path]:
    """Fill a folder by its name, in one of the processes that run the tests, for all of them to read."""
    own = tmp_path_factory.getbasetemp()
    shared = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "shared"
    shared.mkdir(exist_ok=True)

    def made_once(name: str, fill: Callable[[Path], object]) -> Path:
        folder, unfinished = shared / name, shared / f"{name} unfinished"
        with FileLock(shared / f"{name}.lock"):
            if not folder.exists():
                shutil.rmtree(unfinished, ignore_errors=True)
                unfinished.mkdir()
                fill(unfinished)
                unfinished.rename(folder)
        return folder

    return made_once


@pytest.fixture(scope="session")
def rolling(made_once):
    """A repertoire of one dance to clicks, with a rollout network that has hardly learned."""
    from synthetic_motions import stepping
    from synthetic_repertoire import write_clicks

    from choreograph.formats.register import save_motion
    from choreograph.library.building.build import build_repertoire
    from choreograph.library.building.options import BuildOptions
    from choreograph.library.repertoire import Repertoire

    def build(folder: Path) -> None:
        save_motion(folder / "steps.bvh", stepping(30 * 30, period_s=0.5, seed=1))
        write_clicks(folder / "steps.wav", duration_s=30.0)
        build_repertoire([folder], folder / "rep.h5", BuildOptions(preset="tiny", rollout=True))

    return Repertoire.open(made_once("rolling", build) / "rep.h5")


@pytest.fixture(scope="module")
def short_trainings():
    """Trains the networks of the preset `tiny` for a moment only."""
    from short_trainings import shorten_trainings

    from choreograph.nets import configs

    with pytest.MonkeyPatch.context() as patch:
        for name in ("_STYLE_PRESETS", "_WORD_PRESETS", "_ROLLOUT_PRESETS", "_DENSITY_PRESETS"):
            patch.setattr(configs, name, dict(getattr(configs, name)))
        shorten_trainings()
        yield


@pytest.fixture(scope="module")
def chromium():
    """Starts Chromium with the given flags; all are closed at the end. Without one, tests of pages skip."""
    sync_api = pytest.importorskip("playwright.sync_api")
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next((path for name in names if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("no Chromium on this machine: pages are not tried in a browser")
    started = []
    with sync_api.sync_playwright() as playwright:

        def start(flags):
            started.append(playwright.chromium.launch(executable_path=found, args=flags))
            return started[-1]

        yield start
        for browser in started:
            browser.close()
