"""Counts in files of motions: the results of `count` with the animation of a GLB or the stage of USD.

In a GLB, it is the entry `choreograph_counts` of the `extras` of an animation, with the fields that the JSON
of `count` has. Times are those of the keys. In USD, it is that entry of the stage's metadata, with times in
seconds, and an attribute `count` of the animation, whose time samples are the numbers in the bar.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from choreograph.core.counts import ANNOTATED, DATA_SET, NO_COUNTS, Counts, Figure, make_counts
from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats.gltf_document import GltfDocument

KEY = "choreograph_counts"
SPANS = ("loops", "figures")
_OF_FILE = ("name", "kind", "duration_s")  # of the JSON of `count`, which say nothing of the counts


def with_marks(document: GltfDocument, facts: Mapping[str, Any]) -> GltfDocument:
    """A copy of a document whose animations have the `facts` of `CountedFile.facts`."""
    marked = document.copy()
    for animation in marked.json.get("animations", []):
        own = _moved(of_counts(facts), start_s(marked, animation))
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


def of_counts(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the facts of a file that say something of its counts."""
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
        for kind in SPANS
    }
    return {**facts, "times_s": [time_s + by_s for time_s in facts["times_s"]], **spans}
