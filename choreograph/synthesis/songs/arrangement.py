"""A song's form: the order, length and energy of its sections."""

from __future__ import annotations

from dataclasses import dataclass

_ENERGY = {"intro": 0.35, "verse": 0.6, "chorus": 1.0, "break": 0.3, "outro": 0.5}
_FORMS: dict[int, tuple[str, ...]] = {  # by number of phrases
    1: ("chorus",),
    2: ("verse", "chorus"),
    3: ("intro", "verse", "chorus"),
    4: ("verse", "chorus", "break", "chorus"),
    5: ("intro", "verse", "chorus", "break", "chorus"),
    6: ("intro", "verse", "chorus", "break", "chorus", "outro"),
    7: ("intro", "verse", "verse", "chorus", "break", "chorus", "outro"),
    8: ("intro", "verse", "verse", "chorus", "break", "chorus", "chorus", "outro"),
}
_CYCLE = (
    "verse",
    "verse",
    "chorus",
    "chorus",
    "break",
    "chorus",
)  # repeated in longer songs, between intro and outro


@dataclass(frozen=True)
class Section:
    """Consecutive bars with one character."""

    name: str  # intro, verse, chorus, break, outro
    first_bar: int
    bars: int
    energy: float  # 0 (bare) ... 1 (everything plays)


def form(n_bars: int, phrase_bars: int) -> tuple[Section, ...]:
    """Sections that fill `n_bars`: whole phrases, except for one that takes the remainder.

    Extra bars go to the first verse; missing bars are taken from the break or the intro. Consecutive
    phrases with the same name are one section. The first chorus has less energy than later ones.
    """
    names = _names(max(1, round(n_bars / phrase_bars)))
    lengths = [phrase_bars] * len(names)
    left = n_bars - sum(lengths)
    bends = ("verse", "chorus") if left > 0 else ("break", "intro", "verse", "chorus")
    lengths[names.index(next(name for name in bends if name in names))] += left
    sections: list[Section] = []
    bar = 0
    for name, length in zip(names, lengths, strict=True):
        if sections and sections[-1].name == name:
            last = sections.pop()
            sections.append(Section(name, last.first_bar, last.bars + length, last.energy))
        else:
            choruses = sum(section.name == "chorus" for section in sections)
            energy = _ENERGY[name] - (0.1 if name == "chorus" and choruses == 0 else 0.0)
            sections.append(Section(name, bar, length, round(energy, 2)))
        bar += length
    return tuple(sections)


def _names(phrases: int) -> tuple[str, ...]:
    if phrases in _FORMS:
        return _FORMS[phrases]
    return ("intro", *(_CYCLE[i % len(_CYCLE)] for i in range(phrases - 2)), "outro")
