"""Several dances to one song: sessions, variations, and the motifs of an existing dance."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.enforcement import AvoidRepeating
from choreograph.choreography.engine import BUILTIN_ENGINES, engine_named
from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.costs import installed_costs
from choreograph.core.arguments import as_floats, as_list, is_whole, unexpected
from choreograph.core.cache import Memory, digest
from choreograph.core.errors import ParameterError
from choreograph.core.files import as_path
from choreograph.core.numerics import default_numerics
from choreograph.formats.folder import SongsByName
from choreograph.formats.register import read_take
from choreograph.library.building.takes import measure_take
from choreograph.library.building.words import segment_takes
from choreograph.library.repertoire import Repertoire, as_repertoire
from choreograph.library.songs import names_a_tracker
from choreograph.library.vocabulary import signature
from choreograph.motion.motion import Take
from choreograph.motion.retargeting import retarget
from choreograph.music.song import Song, as_song, check_span
from choreograph.pipeline.dancing import DEFAULTS, Dance, DanceArguments, dance_with
from choreograph.pipeline.editing import Alternative, alternatives, as_dance
from choreograph.plan.plan import Plan
from choreograph.settings import MAX_VARIATIONS, DanceConfig, as_config

# A song and a repertoire in memory, from which dances are made.


_MOST_BYTES = 1 << 29  # of the values that a session keeps


class Session:
    """A song and a repertoire in memory, from which dances are made again with other settings.

    `dance` returns what `choreograph.dance` returns for the song and the repertoire of the session, to the
    byte. It is faster from the second dance on, because the session keeps what the dances have in common:
    the decoded song and its analysis, parts of takes, and in the graph engine the warped takes and the
    layers of every second. A dance with the arguments of an earlier one is that dance.

    A session keeps at most 512 MB of such values, beside the song and what the repertoire keeps of its file.
    Values that were not used for longest are removed first.

    Parameters
    ----------
    song : path of any audio file, or a loaded `Song`
    repertoire : the takes to dance with, opened or as a path, by default the built-in ones
    start_s, duration_s : the part of the song, by default the whole song

    Raises `FormatError` if the song cannot be read, `RepertoireError` if the repertoire cannot, and
    `ParameterError` for an argument of a wrong type or value.

    Examples
    --------
    >>> session = cg.Session(cg.example_songs()["house"], duration_s=8)
    >>> first = session.dance()
    >>> calmer = session.dance(weights={"pace": 3.0})
    >>> pinned = session.dance(pins=[cg.TakePin(4.0, 6.0, first.plan.seconds[2].take)])
    >>> pinned.plan.seconds[4].take == first.plan.seconds[2].take
    True
    """

    def __init__(
        self,
        song: str | Path | Song,
        repertoire: str | Path | Repertoire | None = None,
        *,
        start_s: float | None = None,
        duration_s: float | None = None,
    ) -> None:
        start_s = 0.0 if start_s is None else start_s
        check_span(start_s, duration_s)
        self.repertoire = as_repertoire(repertoire)
        self.song = as_song("a song", song, start_s=start_s, duration_s=duration_s)
        self._memory = Memory(_MOST_BYTES)
        self._latest: Dance | None = None

    def dance(self, **arguments: Unpack[DanceArguments]) -> Dance:
        """Make a dance with these `arguments`, the keywords of `choreograph.dance`.

        Nothing of an earlier dance is taken over: settings that are not given have their defaults. `start_s`
        is a time in the song of the session. Raises as `choreograph.dance`.
        """

        def make() -> Dance:
            return dance_with(self._memory, self.song, self.repertoire, **arguments)

        content = _content_of(arguments)
        if content is None:
            self._latest = make()
        else:
            self._latest = deepcopy(self._memory.value(make, "dance", content))  # which the caller may change
        return self._latest

    def alternatives(
        self, span: tuple[float, float], n: int = 8, *, existing: Dance | None = None
    ) -> tuple[Alternative, ...]:
        """What else could be danced in a part of a dance, the cheapest first.

        Each alternative is a whole dance, which differs from the `existing` one only from the first to the
        second time of `span` and one or two counts on either side, as by `choreograph.edit`. Any two of them,
        and the existing dance, are 0.2 m of mean joint distance apart in the span. There may be fewer than
        `n`. By default, the existing dance is the latest one of the session. Its first dance is made if there
        is none.

        Raises `ParameterError` if an argument has a wrong type or the span is outside of the dance,
        `RepertoireError` if the repertoire of the session lacks a take of the dance.

        Examples
        --------
        >>> session = cg.Session(cg.example_songs()["house"], duration_s=8)
        >>> found = session.alternatives((3.0, 5.0), n=2)
        >>> len(found), found[0].cost <= found[1].cost
        (2, True)
        """
        pair = as_floats("a span as two times in seconds", span)
        if pair.shape != (2,):
            raise unexpected("a span as two times in seconds", span)
        latest = self._latest if existing is None else existing
        dance = self.dance() if latest is None else latest
        return alternatives(as_dance(dance, self.repertoire, self.song), self.repertoire, tuple(pair), n)

    def __repr__(self) -> str:
        return f"<Session: {self.song.name}, {self.song.duration_s:.1f} s, {self.repertoire.path.name}>"


def _content_of(arguments: Mapping[str, Any]) -> bytes | None:
    """A digest of the arguments of a dance, if nothing else determines it: no file, and no code of others."""
    given = dict(arguments)
    config, existing = given.get("config", DEFAULTS), given.get("existing")
    if isinstance(existing, Dance):
        given["existing"] = existing.motion, existing.plan
    if not isinstance(config, DanceConfig) or isinstance(existing, str):
        return None
    used = {
        name: given.get(name, getattr(config, name)) for name in ("beats", "style_song", "engine", "weights")
    }
    try:
        of_others = (
            installed_costs([*used["weights"], *config.weights]) or used["engine"] not in BUILTIN_ENGINES
        )
        if of_others or used["style_song"] is not None or not names_a_tracker(used["beats"]):
            return None
        return digest(sorted(given.items()))
    except TypeError:  # something without a content, such as a cost, or of a wrong type
        return None


# Several different dances for one song.


_SEEDS = 3  # tried for each variation


def vary(
    song: str | Path | Song,
    repertoire: str | Path | Repertoire | None = None,
    n: int = 3,
    **arguments: Unpack[DanceArguments],
) -> list[Dance]:
    """Make `n` different dances for one song.

    `arguments` are the keywords of `dance`. The dances have the seeds from `seed` (or that of `config`) on.
    With the graph engine, the takes of earlier variations in a second have a higher cost there in later
    variations.

    Raises as `dance`, and `ParameterError` if `n` is below 1 or above 1000, or if so many different dances
    cannot be found.

    Examples
    --------
    >>> dances = cg.vary(cg.example_songs()["house"], n=2, engine="mixer", duration_s=8)
    >>> [dance.plan.seed for dance in dances]
    [0, 1]
    """
    if not is_whole(n) or not 1 <= n <= MAX_VARIATIONS:
        raise unexpected(f"1 to {MAX_VARIATIONS} variations", n)
    config = as_config(arguments.pop("config", DEFAULTS))
    costs = as_list("costs", arguments.pop("costs", ()), "Cost", Cost)
    if "seed" in arguments:
        config = replace(config, seed=arguments.pop("seed"))
    start_s = arguments.pop("start_s", None)
    duration_s = arguments.pop("duration_s", None)
    session = Session(song, repertoire, start_s=start_s, duration_s=duration_s)
    made: list[Dance] = []
    for seed in range(config.seed, config.seed + _SEEDS * n):
        has_costs = bool(made) and "candidates" in engine_named(made[0].plan.engine).settings
        avoid = (AvoidRepeating([one.plan for one in made]),) if has_costs else ()
        arguments |= {"config": replace(config, seed=seed), "costs": (*costs, *avoid)}
        one = session.dance(**arguments)
        if all(_content(one.plan) != _content(other.plan) for other in made):
            made.append(one)
        if len(made) == n:
            return made
    raise ParameterError(f"expected {n} different dances, got {len(made)}: too little is drawn at random")


def _content(plan: Plan) -> list[tuple[object, ...]]:
    """The parts of a dance without their costs."""
    sources = [(b.start_s, b.planned.take, b.source_start_s, b.source_end_s) for b in plan.blocks]
    return [*sources, *((word.start_s, word.motif) for word in plan.words)]


# The motif sequence and the signature of an existing dance.


@default_numerics()
def motifs_of(take: str | Path, repertoire: Repertoire) -> tuple[int, ...]:
    """The motifs of a dance in order, for a dance to another song.

    `take` is the name of a take of the repertoire, or a motion file (or a folder of one take). A file is
    segmented on the beats of the song beside it, or on its motion beats if there is none.

    Raises `ParameterError` if it is neither or has no motion word, `FormatError` if the file is damaged, and
    `RepertoireError` without a vocabulary.

    Examples
    --------
    >>> repertoire = cg.starter_repertoire()
    >>> motifs = cg.motifs_of("house-05", repertoire)
    >>> dance = cg.dance(cg.example_songs()["house"], motifs=motifs, duration_s=8)
    >>> dance.plan.engine, dance.plan.words[1].motif == motifs[0]  # word 0 is before the first count
    ('mixer', True)
    """
    repertoire = as_repertoire(repertoire)
    vocabulary = repertoire.vocabulary
    as_path("a take, or its name", take)
    names = [info.name for info in repertoire.takes]
    if str(take) in names:
        motifs = vocabulary.word_motif[vocabulary.words_of_take(names.index(str(take)))]
    elif Path(take).exists():
        [cut], _ = segment_takes([measure_take(_on_skeleton(_only_take(Path(take)), repertoire))])
        motifs = vocabulary.motifs.nearest(repertoire.word_net().embed(cut.words.body_pos_m))
    else:
        raise ParameterError(
            f"expected a take of {repertoire.path.name} or a motion file with its song beside it, got {take}"
        )
    if len(motifs) == 0:
        raise ParameterError(f"{take}: expected two beats or more to segment it on, got fewer")
    return tuple(motifs.tolist())


@default_numerics()
def signature_of(name: str, repertoire: Repertoire) -> NDArray[np.float64]:
    """The signature (K,) of a genre, or of a take or motion file as in `motifs_of`, which raises the same.

    Examples
    --------
    >>> shares = cg.signature_of("house", cg.starter_repertoire())
    >>> print(f"{shares.sum():.2f}")
    1.00
    """
    repertoire = as_repertoire(repertoire)
    vocabulary = repertoire.vocabulary
    as_path("a take, or the name of one or of a genre", name)
    if name in vocabulary.genres:
        of_genre: NDArray[np.float64] = vocabulary.signatures[vocabulary.genre_index(name)]
        return of_genre
    return signature(np.array(motifs_of(name, repertoire)), vocabulary.n_motifs)


def _only_take(path: Path) -> Take:
    take = read_take(path)
    song = take.song_path or SongsByName.in_folder(path.parent).of(path.stem)
    return replace(take, song_path=song)


def _on_skeleton(take: Take, repertoire: Repertoire) -> Take:
    if take.motion.skeleton.same_as(repertoire.skeleton):
        return take
    return replace(take, motion=retarget(take.motion, repertoire.skeleton))
