"""What a repertoire file holds as plain data, and which arrays of what shapes."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from choreograph.errors import RepertoireError
from choreograph.repertoire.schema import COUNTS, DATASETS, DOUBT, MOTIFS, ROLES, VERSION, WITH_COUNTS


@dataclass(frozen=True, eq=False)
class NetArrays:
    """One network as plain data: its config and weights."""

    config: dict[str, Any]
    weights: dict[str, NDArray]


@dataclass(frozen=True, eq=False)
class Contents:
    """Everything in a repertoire file."""

    # By path: all of `schema.DATASETS` and `COUNTS`, all or none of `MOTIFS`, of `DOUBT` and of `ROLES`.
    arrays: Mapping[str, NDArray]
    density: str  # which tempo-density `body/density` holds: "analytic" or "learned"
    provenance: dict[str, Any]  # program version, seed, preset, losses, training and held-out songs
    nets: Mapping[str, NetArrays] = field(default_factory=dict)


def layout_of(names: Container[str], version: int = VERSION) -> dict[str, tuple[str, str]]:
    """The datasets of a file with these names: all or none of `schema.MOTIFS`, `DOUBT`, `ROLES`."""
    layout = DATASETS | (COUNTS if version >= WITH_COUNTS else {})
    for optional in (DOUBT, MOTIFS, ROLES):
        if any(name in names for name in optional):
            layout |= optional
    return layout


def axis_sizes(shapes: Mapping[str, tuple[int, ...]], version: int = VERSION) -> dict[str, int]:
    """The lengths of the axes; `RepertoireError` for a shape that contradicts the schema or one before it."""
    sizes: dict[str, int] = {}
    for name, (_, axes) in layout_of(shapes, version).items():
        letters, shape = axes.split(), shapes[name]
        sizes |= {letter: int(letter) for letter in letters if letter.isdigit()}
        if len(shape) != len(letters) or any(
            sizes.setdefault(letter, n) != n for letter, n in zip(letters, shape, strict=True)
        ):
            known = ", ".join(f"{letter} = {sizes[letter]}" for letter in letters if letter in sizes)
            raise RepertoireError(f"{name}: expected ({axes}) with {known}, got {shape}")
    return sizes
