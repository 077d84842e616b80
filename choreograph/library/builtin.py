"""The built-in repertoire and songs, and the networks that ship with the package."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from choreograph.core.arguments import unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.files import sha256_of
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import NetArrays
from choreograph.library.store import RepertoireFile, read_networks

# The built-in repertoire and songs.


STARTER_PATH = Path(__file__).parent / "shipped" / "starter.h5"
SONGS_PATH = Path(__file__).parent / "shipped" / "songs"


def starter_repertoire() -> Repertoire:
    """Open the built-in repertoire: synthetic takes in fifteen genres with their networks and motifs.

    Raises
    ------
    RepertoireError   if the installation lacks the file

    Examples
    --------
    >>> repertoire = cg.starter_repertoire()
    >>> repertoire
    <Repertoire starter.h5: 345 takes, 94.2 min, 3,071 clips, genres: Charleston, ...>
    """
    return Repertoire(RepertoireFile(STARTER_PATH))


def as_repertoire(repertoire: object) -> Repertoire:
    """An opened repertoire, for None or no paths the built-in one.

    Raises `ParameterError` unless given one, a path, or a list of paths.
    """
    if repertoire is None or (isinstance(repertoire, tuple) and not repertoire):
        return starter_repertoire()
    if isinstance(repertoire, Repertoire):
        return repertoire
    if not isinstance(repertoire, str | Path | list | tuple):
        raise unexpected("a repertoire or its path", repertoire)
    return Repertoire.open(repertoire)


def example_songs() -> dict[str, Path]:
    """The built-in songs, by name.

    Returns
    -------
    dict   name to path of the sound file

    Examples
    --------
    >>> songs = cg.example_songs()
    >>> sorted(songs)
    ['cha-cha', 'house', 'waltz']
    >>> song = cg.load_song(songs["house"])
    """
    return {path.stem: path for path in sorted(SONGS_PATH.glob("*.ogg"))}


# The networks that ship with the package.


PRETRAINED = ("clean", "research")
DEFAULT, NOTHING = "default", "nothing"
CHOICES = (DEFAULT, *PRETRAINED, NOTHING)
# The set "clean" is used if it is as good (`research/results/style.md`, `research/results/motion_counts.md`).
_BY_DEFAULT = {"style": "clean", "motion_counts": "research"}
_DESCRIPTIONS = {
    "clean": "the networks 'clean', trained on the program's own takes",
    "research": "the networks 'research', also trained on data that states no licence (--pretrained clean: "
    "without)",
}


@dataclass(frozen=True, eq=False)
class PretrainedNet:
    """A network of one of the sets."""

    set_name: str
    arrays: NetArrays
    trained_on: tuple[str, ...]  # names of songs and takes

    @property
    def description(self) -> str:
        """The set and its training data, in one line."""
        return _DESCRIPTIONS[self.set_name]


def pretrained_set(name: str) -> dict[str, PretrainedNet]:
    """The networks of a set by name. "nothing" has none. "default" has the better set for each network.

    Raises `ParameterError` for an unknown name, `RepertoireError` if the installation lacks a file.
    """
    if name not in CHOICES:
        raise ParameterError(f"expected pretrained among {', '.join(CHOICES)}, got {name!r}")
    chosen = {}
    for set_name in PRETRAINED:
        if name not in (DEFAULT, set_name):
            continue
        nets, provenance = read_networks(pretrained_path(set_name))
        trained_on = tuple(provenance.get("trained_on", ()))
        for net_name, arrays in nets.items():
            if name == set_name or _BY_DEFAULT[net_name] == set_name:
                chosen[net_name] = PretrainedNet(set_name, arrays, trained_on)
    return chosen


def shipped_checksums(name: str) -> list[str]:
    """SHA-256 of the files that `pretrained_set` reads for a choice."""
    return [sha256_of(pretrained_path(set_name)) for set_name in PRETRAINED if name in (DEFAULT, set_name)]


def pretrained_path(name: str) -> Path:
    """The file of a set."""
    return Path(__file__).parent / "shipped" / f"{name}.h5"
