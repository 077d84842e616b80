"""Counts in files of motions: what `count` knows, with the animation of a GLB or the stage of USD.

In a GLB, it is the entry `choreograph_counts` of the `extras` of an animation, with the fields that the JSON
of `count` has. Times are those of the keys. In USD, it is that entry of the stage's metadata, with times in
seconds, and an attribute `count` of the animation, whose time samples are the numbers in the bar.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from choreograph.core.counts import ANNOTATED, DATA_SET, NO_COUNTS, Counts, Figure, make_counts
from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats.gltf_document import GltfDocument

if TYPE_CHECKING:
    from pxr import Usd

KEY = "choreograph_counts"
_SPANS = ("loops", "figures")
_OF_FILE = ("name", "kind", "duration_s")  # of the JSON of `count`, which say nothing of the counts


def with_marks(document: GltfDocument, facts: Mapping[str, Any]) -> GltfDocument:
    """A copy of a document whose animations have the `facts` of `CountedFile.facts`."""
    marked = document.copy()
    for animation in marked.json.get("animations", []):
        own = _moved(_of_counts(facts), start_s(marked, animation))
        animation["extras"] = {**_extras(animation), KEY: own}
    return marked


def marks_of(document: GltfDocument, animation: Mapping[str, Any]) -> tuple[Counts, tuple[Figure, ...]]:
    """The counts and figures with an animation, in seconds from its first key. None if they are not certain.

    Counts that were written by hand have the source "data set", so that a table beside the file replaces
    them. Raises `FormatError` if they are damaged.
    """
    facts = _extras(animation).get(KEY)
    if facts is None:
        return NO_COUNTS, ()
    try:
        facts = _moved(facts, -start_s(document, animation))
        if not facts["is_sure"]:
            return NO_COUNTS, ()
        source = DATA_SET if facts["source"] == ANNOTATED else str(facts["source"])
        counts = make_counts(
            facts["times_s"], facts["numbers"], int(facts["metre"]), source=source,
            confidence=float(facts["confidence"]),
        )  # fmt: skip
        figures = [
            Figure(str(each["name"]), each["start_s"], each["end_s"], int(each["n_counts"]))
            for each in facts["figures"]
        ]
    except (KeyError, TypeError, ValueError, ParameterError) as error:
        raise FormatError(
            f"{document.name}: expected {KEY} as `choreograph count` writes it: {error}"
        ) from None
    return counts, tuple(figures)


def start_s(document: GltfDocument, animation: Mapping[str, Any]) -> float:
    """The time of the first key of an animation, 0 if it has none."""
    inputs = {sampler.get("input") for sampler in animation.get("samplers", [])}
    firsts = [float(document.array(index, most=1)[0]) for index in inputs if index is not None]
    return min(firsts, default=0.0)


def mark_stage(stage: Usd.Stage, prim_path: str, facts: Mapping[str, Any]) -> None:
    """Add the `facts` of `CountedFile.facts` to a stage, with time samples on the prim of the animation."""
    from pxr import Sdf

    stage.GetRootLayer().customLayerData = {KEY: _in_usd(_of_counts(facts))}
    fps = stage.GetTimeCodesPerSecond()
    count = stage.GetPrimAtPath(prim_path).CreateAttribute("count", Sdf.ValueTypeNames.Int, custom=True)
    for time_s, number in zip(facts["times_s"], facts["numbers"], strict=True):
        count.Set(int(number), time_s * fps)


def _of_counts(facts: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in facts.items() if name not in _OF_FILE}


def _extras(animation: Mapping[str, Any]) -> dict[str, Any]:
    extras = animation.get("extras")
    return extras if isinstance(extras, dict) else {}


def _moved(facts: Mapping[str, Any], by_s: float) -> dict[str, Any]:
    """The facts with all times later by `by_s`."""
    if by_s == 0.0:
        return dict(facts)
    spans: dict[str, list[dict[str, Any]]] = {
        kind: [
            {**each, "start_s": each["start_s"] + by_s, "end_s": each["end_s"] + by_s} for each in facts[kind]
        ]
        for kind in _SPANS
    }
    return {**facts, "times_s": [time_s + by_s for time_s in facts["times_s"]], **spans}


def _in_usd(facts: Mapping[str, Any]) -> dict[str, Any]:
    """The facts as values that USD stores: arrays of numbers, and a dictionary for each loop and figure."""
    from pxr import Vt

    stored: dict[str, Any] = {}
    for name, value in facts.items():
        if name in _SPANS:
            stored[name] = {f"{name[:-1]}_{number + 1}": dict(each) for number, each in enumerate(value)}
        elif isinstance(value, Sequence) and not isinstance(value, str):
            kind = Vt.IntArray if name == "numbers" else Vt.DoubleArray
            stored[name] = kind.FromNumpy(np.array(value, np.int32 if name == "numbers" else np.float64))
        elif value is not None:
            stored[name] = value
    return stored
