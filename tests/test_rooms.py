"""Imports go one way: each room says what it may import, and each third-party library has its homes.

A room that is not listed here fails, and so does a library that is not.
"""

from __future__ import annotations

import copy
import sys
from functools import lru_cache

import grimp
import pytest

PACKAGE = "choreograph"
BELOW_LIBRARY = ("core", "music", "motion", "formats", "nets")
BELOW_VIEW = (
    *BELOW_LIBRARY,
    "characters",
    "library",
    "settings",
    "plan",
    "render",
    "choreography",
)
# What each room, or module at the top, may import beside itself.
MAY_IMPORT: dict[str, tuple[str, ...]] = {
    "core": (),
    "music": ("core",),
    "motion": ("core",),
    "formats": ("core", "music", "motion"),
    "nets": ("core", "music", "motion"),
    "characters": ("core", "motion", "formats"),
    "library": BELOW_LIBRARY,
    "settings": (*BELOW_LIBRARY, "library"),
    "plan": (*BELOW_LIBRARY, "library", "settings"),
    "render": (*BELOW_LIBRARY, "library", "settings", "plan"),
    "choreography": (*BELOW_LIBRARY, "library", "settings", "plan"),
    "view": BELOW_VIEW,
    "pipeline": (*BELOW_VIEW, "view"),
    "live": (*BELOW_VIEW, "view", "pipeline"),
    "evaluation": (*BELOW_VIEW, "view", "pipeline", "live"),
    "studio": (*BELOW_VIEW, "view", "pipeline", "live", "evaluation"),
    "cli": (*BELOW_VIEW, "view", "pipeline", "live", "evaluation", "studio", ""),
    "__main__": ("cli",),
    "": (),
}
METRICS_MAY_IMPORT = ("core", "music", "motion")
# Where a library may be imported; `None`: anywhere.
HOMES: dict[str, tuple[str, ...] | None] = {
    "numpy": None,
    "scipy": None,
    "PIL": ("view", "evaluation.plots"),
    "av": ("music.decoding", "view"),
    "beat_this": ("music.beats",),
    "bpy": ("formats._in_blender",),
    "c3d": ("formats.c3d",),
    "click": ("cli",),
    "click_option_group": ("cli",),
    "filelock": ("core",),
    "h11": ("studio.server",),
    "h5py": ("library.store", "library.writing"),
    "lazy_loader": ("", "evaluation"),
    "librosa": ("music.beats", "evaluation.metrics.labels"),
    "matplotlib": ("view.strip", "evaluation.plots"),
    "networkx": ("choreography.graph.planners",),
    "numba": ("core.kernel_cache",),
    "distributed": ("core.clusters",),
    "fastapi": ("studio",),
    "fsspec": ("formats.download",),
    "joblib": ("core.workers",),
    "platformdirs": ("core", "cli"),
    "pooch": ("formats.download",),
    "pxr": ("formats.usd",),
    "pydantic": ("studio.dance_routes", "studio.file_routes"),
    "requests": ("formats.download",),
    "rich": ("cli",),
    "sklearn": ("library.vocabulary",),
    "sounddevice": ("live.sound",),
    "websockets": ("live.websocket",),
    "soundfile": ("music",),
    "soxr": ("music.song",),
    "starlette": ("studio",),
    "threadpoolctl": ("core.numerics", "library.vocabulary", "choreography.graph.planners"),
    "torch": ("nets", "core.numerics"),
    "uvicorn": ("studio.server",),
}


@lru_cache(maxsize=1)
def graph() -> grimp.ImportGraph:
    return grimp.build_graph(PACKAGE, include_external_packages=True, cache_dir=None)


def room_of(module: str) -> str:
    return module.removeprefix(PACKAGE).removeprefix(".").split(".")[0]


def within(module: str, place: str) -> bool:
    short = module.removeprefix(PACKAGE).removeprefix(".")
    return short == place or (place != "" and short.startswith(f"{place}."))


def violations(imports: grimp.ImportGraph) -> list[str]:
    """A line for each import that no room may have."""
    found = []
    for module in sorted(m for m in imports.modules if m.split(".")[0] == PACKAGE):
        room = room_of(module)
        if room not in MAY_IMPORT:
            found.append(f"{module}: the room {room!r} is not placed: say in MAY_IMPORT what it may import")
            continue
        allowed = METRICS_MAY_IMPORT if within(module, "evaluation.metrics") else (*MAY_IMPORT[room], room)
        for other in sorted(imports.find_modules_directly_imported_by(module)):
            library = other.split(".")[0]
            if library == PACKAGE:
                metrics = within(module, "evaluation.metrics") and within(other, "evaluation.metrics")
                if room_of(other) not in allowed and not metrics:
                    found.append(f"{module} imports {other}")
            elif library not in sys.stdlib_module_names:
                homes = HOMES.get(library, ())
                if homes is not None and not any(within(module, home) for home in homes):
                    found.append(f"{module} imports {library}, whose homes are {homes}")
    return found


def test_every_import_is_one_that_its_room_may_have():
    assert violations(graph()) == []


@pytest.mark.parametrize(
    ("module", "imported"),
    [
        ("characters.character", "pipeline.dancing"),
        ("formats.gltf_document", "library.repertoire"),
        ("formats.fbx", "choreography.engine"),
        ("library.builtin", "cli.present"),
        ("pipeline.building", "h5py"),
        ("music.beats", "motion.motion"),
        ("render.assembly", "click"),
        ("choreography.mixer.engine", "render.rendering"),
        ("choreography.graph.costs", "evaluation.metrics.beat"),
        ("evaluation.metrics.beat", "choreography.graph.costs"),
        ("nets.style", "librosa"),
        ("server.requests", "core.errors"),
        ("core.files", "requests"),
    ],
)
def test_a_planted_violation_is_found(module, imported):
    planted = copy.deepcopy(graph())
    module = f"{PACKAGE}.{module}"
    target = imported if "." not in imported else f"{PACKAGE}.{imported}"
    for name in (module, target):
        if name not in planted.modules:
            planted.add_module(name, is_squashed=not name.startswith(PACKAGE))
    planted.add_import(importer=module, imported=target)
    found = violations(planted)
    assert found and all(module in line for line in found)
