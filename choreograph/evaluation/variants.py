"""Variants to compare, and their dances, which are kept until an evaluation is complete."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.engine import engines
from choreograph.core.errors import ChoreographError, ParameterError, RepertoireError
from choreograph.core.files import atomic_path, locked_folder, sha256_of
from choreograph.core.timebase import CLIP_S, NODE_FRAMES, SEGMENT_S
from choreograph.evaluation.songs import EvaluatedSong
from choreograph.formats.npz import read_npz
from choreograph.formats.register import save_motion
from choreograph.library.repertoire import Repertoire
from choreograph.music.song import Song
from choreograph.pipeline import published
from choreograph.pipeline.dancing import Dance, dance
from choreograph.plan.plan import Plan, PlannedSecond
from choreograph.render.rendering import render
from choreograph.settings import TRANSITION_LENGTHS_S, DanceConfig

# Variants to compare: the engines, the published method, and baselines.


@dataclass(frozen=True)
class Variant:
    """A way to dance: the settings of an engine, or random clips."""

    name: str
    description: str  # one line in the report
    config: DanceConfig = field(default_factory=DanceConfig)
    seeded: bool = True  # whether the dance depends on the seed
    random_clips: bool = False
    method: str = ""  # the provenance of its repertoires begins with this, "" for any


VARIANTS: dict[str, Variant] = {
    variant.name: variant
    for variant in (
        Variant("ours", "the defaults"),
        Variant("greedy", "ours with the greedy planner", DanceConfig(planner="greedy")),
        Variant("mixer", "the mixer engine: motion words of takes", DanceConfig(engine="mixer")),
        Variant("rollout", "the rollout engine: motion from a network", DanceConfig(engine="rollout")),
        Variant(
            "as-published",
            "ChoreoGraph as published, throughout: networks, selection, warping, graph and blending",
            published.published_dance(),
            seeded=False,
            method=published.METHOD,
        ),
        Variant(
            "random",
            "random clips: their middle 4 s unwarped, linear blending",
            DanceConfig(blending="linear", transitions="seconds"),
            random_clips=True,
        ),
    )
}
GROUPS: dict[str, tuple[str, ...]] = {
    "engines": ("ours", "mixer", "rollout"),
    "baselines": ("ours", "greedy", "random"),
}


def variants_named(
    names: Sequence[str],
    variants: Mapping[str, Variant] = VARIANTS,
    groups: Mapping[str, tuple[str, ...]] = GROUPS,
) -> tuple[Variant, ...]:
    """The variants with these names or in these groups, each once. `ParameterError` for an unknown name."""
    chosen: dict[str, Variant] = {}
    for name in names:
        if name not in groups and name not in variants:
            raise ParameterError(f"expected variants among {', '.join([*groups, *variants])}, got {name!r}")
        chosen.update({member: variants[member] for member in groups.get(name, (name,))})
    return tuple(chosen.values())


def check_variant(variant: Variant, repertoire: Repertoire) -> None:
    """Raise `RepertoireError` or `ParameterError`, before any work, if the repertoire cannot dance it."""
    built_by = repertoire.provenance.get("method", "ours")
    if not built_by.startswith(variant.method):
        raise RepertoireError(
            f"{repertoire.path}: expected a repertoire of `choreograph build-db --{variant.method}` for "
            f"{variant.name}, got one built otherwise: its networks were trained by another method"
        )
    if not variant.random_clips:
        try:
            engines()[variant.config.engine].check(repertoire, variant.config, Constraints(), ())
        except ChoreographError as error:
            raise type(error)(f"cannot dance the variant {variant.name}: {error}") from error
    elif repertoire.n_clips == 0:
        raise RepertoireError(
            f"{repertoire.path}: expected clips, got none: all takes are shorter than {CLIP_S} s"
        )


def dance_variant(variant: Variant, song: Song, repertoire: Repertoire, *, seed: int = 0) -> Dance:
    """The dance of the variant to a song. Raises as `dance` and `check_variant` do."""
    check_variant(variant, repertoire)
    config = replace(variant.config, seed=seed)
    if not variant.random_clips:
        return dance(song, repertoire, config=config)
    plan = _random_plan(song, repertoire, config)
    return Dance(render(plan, repertoire), plan, song_path=song.path)


def _random_plan(song: Song, repertoire: Repertoire, config: DanceConfig) -> Plan:
    """A random clip for every 4 s: its middle 4 s at recorded speed."""
    n_seconds = max(1, int(np.ceil(song.duration_s - 1e-9)))
    drawn = np.random.default_rng(config.seed).integers(repertoire.n_clips, size=-(-n_seconds // SEGMENT_S))
    seconds = []
    for second in range(n_seconds):
        clip, offset = int(drawn[second // SEGMENT_S]), second % SEGMENT_S
        take = repertoire.takes[int(repertoire.clip_take[clip])]
        first_s = repertoire.clip_start_s(clip) + (CLIP_S - SEGMENT_S) / 2 + offset
        seconds.append(
            PlannedSecond(
                second=second, take=take.name, clip=clip, clip_start_s=repertoire.clip_start_s(clip),
                segment_second=second - offset, offset=offset,
                source_times_s=tuple(np.linspace(first_s, first_s + 1.0, NODE_FRAMES + 1).tolist()),
                start_s=float(second), transition_s=TRANSITION_LENGTHS_S[config.blending][0],
                costs={}, credits=take.credits,
            )
        )  # fmt: skip
    return Plan(
        song=song.name, duration_s=song.duration_s, start_s=song.start_s, repertoire=repertoire.path.name,
        planner="greedy", blending=config.blending, seed=config.seed, fps=config.fps, weights={},
        music_beats_s=(), seconds=tuple(seconds),
    )  # fmt: skip


# Dances of an evaluation are kept until it is complete, so that one that was stopped can be resumed.
#
# Dancing takes most of the time. The motion, the plan and the notes of each dance are kept in a folder. The
# dance is measured again when the evaluation is resumed, so that the results are those of an evaluation
# without a stop. A dance is identified by the bytes of song and repertoire, the part of the song, the
# settings of the variant, and the seed.


_DIGITS = 32  # of the checksum that a dance's files are named by
_NAME = "?" * _DIGITS


class KeptDances:
    """The dances in a folder. Open it with `kept_dances`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._checksums: dict[Path, str] = {}  # of songs and repertoires

    def __len__(self) -> int:
        return len(list(self._folder.glob(f"{_NAME}.json"))) if self._folder.exists() else 0

    def find(self, song: EvaluatedSong, variant: Variant, seed: int, repertoire: Repertoire) -> Dance | None:
        """The dance, if it was kept. None if it is damaged."""
        path = self._path(song, variant, seed, repertoire)
        if not path.exists():
            return None
        try:
            stored = json.loads(path.read_text(encoding="utf-8"))
            motion = read_npz(path.with_suffix(".npz"))
            plan = Plan.from_json(json.dumps(stored["plan"]), name=str(path))
            return Dance(motion, plan, tuple(map(str, stored["notes"])), song.path)
        except (OSError, ValueError, KeyError, TypeError, ChoreographError):
            return None

    def keep(
        self, song: EvaluatedSong, variant: Variant, seed: int, repertoire: Repertoire, dance: Dance
    ) -> None:
        """Keep a dance. `ChoreographError` if it cannot be written."""
        path = self._path(song, variant, seed, repertoire)
        save_motion(path.with_suffix(".npz"), dance.motion)
        text = json.dumps({"plan": json.loads(dance.plan.to_json()), "notes": dance.notes})
        with atomic_path(path) as temporary:  # last: with it, the dance is complete
            temporary.write_text(text, encoding="utf-8")

    def clear(self) -> None:
        """Remove all dances, and the files that killed processes left."""
        for pattern in (f"{_NAME}.json", f"{_NAME}.npz", f".{_NAME}.*"):
            for path in self._folder.glob(pattern):
                path.unlink(missing_ok=True)

    def _path(self, song: EvaluatedSong, variant: Variant, seed: int, repertoire: Repertoire) -> Path:
        made_of = {
            "choreograph": version("choreograph"),
            "song": self._checksum(song.path),
            "part_s": [song.start_s, song.duration_s],
            "repertoire": [self._checksum(path) for path in repertoire.paths],
            "variant": asdict(variant),
            "seed": seed,
        }
        digest = hashlib.sha256(json.dumps(made_of, sort_keys=True, default=str).encode()).hexdigest()
        return self._folder / f"{digest[:_DIGITS]}.json"

    def _checksum(self, path: Path) -> str:
        if path not in self._checksums:
            self._checksums[path] = sha256_of(path)
        return self._checksums[path]


@contextmanager
def kept_dances(folder: Path, *, resume: bool, doing: str) -> Iterator[KeptDances]:
    """The dances kept in `folder` while the block runs, removed when it ends without an error.

    Without `resume` those of an evaluation that was stopped are removed first. Raises `ChoreographError` if
    another process evaluates there. `doing` describes this one in its message.
    """
    with locked_folder(folder, doing=doing):
        kept = KeptDances(folder)
        if not resume:
            kept.clear()
        yield kept
        kept.clear()
