"""The options of `choreograph dance`, in the groups of its `--help`.

Settings have no default here, since the pipeline distinguishes those that were given. It raises an error for
those that the chosen engine does not use.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click_option_group import optgroup

from choreograph.cli.characters import TARGET_NAMES
from choreograph.cli.declared import (
    Command,
    Given,
    Input,
    Output,
    Seconds,
    SongTime,
    SongTimes,
    after_equals,
    given_parameters,
    given_settings,
    grouped,
    whole,
)
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.formats import output_formats
from choreograph.settings import MAX_VARIATIONS, DanceConfig, engine_names, load_config

if TYPE_CHECKING:
    from choreograph.choreography.edits import EditRequest
    from choreograph.formats.writer import TargetName
    from choreograph.library.repertoire import Repertoire
    from choreograph.motion.cameras import CameraMode
    from choreograph.pipeline.dancing import DanceArguments

AnyCommand = TypeVar("AnyCommand", bound=Callable[..., Any])
Options = TypeVar("Options")
SONG = "{song}"  # in the name of a file, replaced by the name of the song without its suffix
PUBLISHED = "published"  # instead of a file, for the settings of the paper of the engine
CAMERA_MODES: tuple[CameraMode, ...] = ("front", "follow", "cuts")
# Options that this command had, and that `convert` has.
_OF_CONVERT = ("--names", "--units", "--rest", "--in-place")


# The modes of the command: a new dance, an edit of an existing one, and a plan that is rendered.
_NEW, _EDIT, _PLAN = "", "edit", "plan"
_planned = partial(grouped, modes=(_NEW,))
_edited = partial(grouped, modes=(_NEW, _EDIT))
_edit = partial(grouped, modes=(_EDIT,), selects=_EDIT, needs="existing")
_REASONS = {_EDIT: "keeps all else of the existing dance", _PLAN: "decides what is danced"}


class DanceCommand(Command):
    """`choreograph dance`, which says what to write instead of options that it had."""

    def __init__(self, *args: Any, **attrs: Any) -> None:
        super().__init__(*args, reasons=_REASONS, **attrs)

    def mode(self, ctx: click.Context) -> str:
        """As in the class. Pins and bans of an existing dance are edits, unless parts of it are kept."""
        given = {param.name for param in given_parameters(ctx)}
        if (
            "plan_path" not in given
            and "existing" in given
            and not given & {"keep", "swap", "vary", "repeat"}
        ):
            if not given & {"pin", "ban"}:
                raise ParameterError(
                    "expected --keep, --swap, --vary, --repeat, --pin or --ban beside --existing, got none"
                )
            return _EDIT
        return super().mode(ctx)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does. Raises `ParameterError` for an option that was moved."""
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            if error.option_name not in _OF_CONVERT:
                raise
            raise ParameterError(
                f"expected no {error.option_name}, which `convert` has: write `choreograph convert dance.bvh "
                f"other.bvh {error.option_name}`"
            ) from None


def default_names(song: Path) -> tuple[Path, ...]:
    """The files of a dance to a song, or of a plan, if no others are given: a motion and a page."""
    stem = song.stem if song.stem.strip(".") else song.name
    return Path(f"{stem}.bvh"), Path(f"{stem}.html")


def _defaults(given: Given) -> Iterator[Path]:
    songs = given["songs"] or tuple(filter(None, [given["plan_path"]]))
    variations = None if given["variations"] is None else min(given["variations"], MAX_VARIATIONS)
    for path in (name for song in songs for name in default_names(song)):
        yield from numbered(path, variations)


def numbered(path: Path, variations: int | None) -> tuple[Path, ...]:
    """The file of each variation, NAME-1.bvh for NAME.bvh, or without variations the path itself."""
    if variations is None:
        return (path,)
    return tuple(path.with_name(f"{path.stem}-{number + 1}{path.suffix}") for number in range(variations))


def _named(path: Path, given: Given) -> tuple[Path, ...]:
    """What is written for a name that the user gave whole. Other names are made, of no file that is read."""
    if given["variations"] is not None or SONG in str(path):
        return ()
    has_sound = given["target"] == "mmd" and path.suffix.lower() == ".vmd"
    return (path, path.with_suffix(".wav")) if has_sound else (path,)


def formats_of_dances() -> str:
    """The formats that dances are written in, and what their files hold, for the help."""
    held: dict[str, list[str]] = {}
    for format in output_formats().values():
        held.setdefault(format.holds, []).append(f".{format.name}")
    return " ".join(f"{', '.join(suffixes)}: {what}." for what, suffixes in held.items())


_SOURCES = (
    grouped(
        "--db", type=Input("repertoire"), multiple=True, metavar="FILE|DIR",
        help="Repertoire, or a folder of several. Repeatable. Default: the built-in one.",
    ),
    _planned(
        "--start", type=SongTime(),
        help="Where in the song to begin: 75.5, 1:15.5, bar 9 or chorus 2 (0).",
    ),
    _planned(
        "--duration", type=Seconds(), help="Length of the dance (to the end of the song)."
    ),
    _planned(
        "--beats", type=Input("beats", whole), metavar="network|tempo-path|librosa|beat-this|FILE",
        help="Beat tracker (network), or a text file with a beat on each line: its time in seconds and, if "
        "known, its number in the bar.",
    ),
)  # fmt: skip

_CONSTRAINTS = (
    _planned("--genre", help="Genre to follow (the nearest to the song)."),
    _planned(
        "--signature", type=Input("list"),
        help="Dance each motif as often as in this file. `inspect --signature` writes one.",
    ),
    _planned(
        "--motifs", type=Input("motion", whole), metavar="FILE|TAKE",
        help="Dance these motifs in this order: those of a plan, of a list (.json), of a take of the "
        "repertoire, or of a motion file.",
    ),
    _edited(
        "--pin", multiple=True, metavar="SECOND=motif:N|FROM-TO=take:NAME",
        help="Dance this motif or take at this time. Repeatable, as the next five.",
    ),
    _edited(
        "--ban", multiple=True, metavar="KIND:NAME",
        help="Never dance this: take, genre, performer, licence or motif, such as genre:tango.",
    ),
    _planned(
        "--keep", multiple=True, needs="existing", metavar="FROM-TO",
        help="Keep this part, and plan the rest again.",
    ),
    _edit(
        "--swap", multiple=True, metavar="FROM-TO",
        help="Dance something else in this part of it.",
    ),
    _edit(
        "--vary", multiple=True, metavar="FROM-TO",
        help="Dance something similar in this part of it.",
    ),
    _edit(
        "--repeat", multiple=True, metavar="FROM-TO@TIME[=mirror]",
        help="Dance this part of the existing dance, or its mirror image, again at a time.",
    ),
    grouped(
        "--existing", type=Input("plan"),
        help="The dance to edit or to keep parts of: .bvh, .npz or a plan. Without --keep, pins and bans "
        "change only their time.",
    ),
    _edited(
        "--strict", is_flag=True,
        help="Fail if a pin, ban or motif is not danced. Otherwise, a note is printed.",
    ),
    grouped(
        "--plan", "plan_path", type=Input("plan"), selects=_PLAN,
        help="Render this plan, edited or not. SONG is then only the sound of a page or video.",
    ),
)  # fmt: skip

_SETTINGS = (
    _planned(
        "--engine", metavar="|".join(engine_names()),
        help="Join seconds of takes (graph, the default) or motion words of takes (mixer), or generate "
        "motion with a network (rollout).",
    ),
    _edited("--seed", type=int, help="Another seed gives another dance (0)."),
    _planned("--fps", type=float, saves="fps", help="Frames per second of the dance (60)."),
    _planned(
        "--weight", multiple=True, metavar="COST=NUMBER",
        help="Weight of a cost of the graph engine, such as transition=8. 0 leaves it out. Repeatable. "
        "`choreograph settings weights` lists the costs.",
    ),
    _planned(
        "--set", "assigned", type=Input("setting", after_equals), multiple=True, metavar="NAME=VALUE",
        help="Any other setting, such as planner=greedy. Repeatable. `choreograph settings` lists them.",
    ),
    _planned(
        "--config", type=Input("config", whole), metavar="FILE|published",
        help="TOML file of settings, or published, for those of the paper. Options and --set replace them.",
    ),
    _planned(
        "--variations", type=int, metavar="N", help="Make N different dances, NAME-1.bvh to -N."
    ),
    grouped(
        "--workers", type=int, metavar="N", help="Songs danced at once (1). 0: one a CPU core."
    ),
    grouped(
        "--dask", metavar="ADDRESS",
        help="Dask scheduler to dance the songs.",
    ),
)  # fmt: skip

_OUTPUT = (
    grouped(
        "-o", "--output", multiple=True, type=Output(_named, _defaults), completed=formats_of_dances,
        help="File to write. Repeatable. Default: SONG.bvh and SONG.html here. {song}: the song's name.",
    ),
    grouped(
        "--character", type=Input("character"), saves="character",
        help="Character (.glb, .gltf, .vrm, .fbx) that dances.",
    ),
    grouped(
        "--map", "map_path", type=Input("map"), needs="character",
        help="Bones of the character, edited (.json).",
    ),
    grouped("--save-map", type=Output(), needs="character", help="Write the bones that were found (.json)."),
    grouped(
        "--camera", type=click.Choice(CAMERA_MODES), saves="camera",
        help="Film it from the audience, follow it, or cut on phrases.",
    ),
    grouped(
        "--for", "target", type=click.Choice(TARGET_NAMES), metavar="PROGRAM", saves="target",
        help=f"Write for it: {', '.join(TARGET_NAMES)}.",
    ),
    grouped("--loop", is_flag=True, saves="loop", help="Cut it to whole bars that can be looped."),
    grouped(
        "--click", "with_clicks", is_flag=True, saves="click",
        help="Mix in a click on each count.",
    ),
    grouped(
        "--force", is_flag=True, help="Replace files that are not dances, if -o is not given."
    ),
    grouped("--open", "opened", is_flag=True, help="Open the page in the browser."),
    grouped(
        "--json", "as_json", is_flag=True,
        help="Print the results as JSON, and progress as lines on stderr: STAGE DONE/TOTAL.",
    ),
    grouped("-q", "--quiet", is_flag=True, help="Print no progress, notes or summary."),
)  # fmt: skip

_GROUPS = (
    ("Song and repertoire", _SOURCES),
    ("What is danced", _CONSTRAINTS),
    ("Engine and settings", _SETTINGS),
    ("Output", _OUTPUT),
)


def dance_options(command: AnyCommand) -> AnyCommand:
    """Add the options, group by group."""
    for name, options in reversed(_GROUPS):
        for option in reversed(options):
            command = option(command)
        command = optgroup.group(name)(command)
    return command


def options_of(kind: type[Options], given: dict[str, Any]) -> Options:
    """The options for the fields of a dataclass."""
    return kind(**{field.name: given[field.name] for field in fields(kind)})  # type: ignore[arg-type]


@dataclass(frozen=True)
class FileOptions:
    """The options of the files and of the printed output."""

    output: tuple[Path, ...]
    character: Path | None
    map_path: Path | None
    save_map: Path | None
    camera: CameraMode | None
    target: TargetName | None
    loop: bool
    with_clicks: bool
    force: bool
    opened: bool
    as_json: bool
    quiet: bool


@dataclass(frozen=True)
class DanceOptions:
    """The options of the planning."""

    start: float | str | None
    duration: float | None
    beats: str | None
    genre: str | None
    signature: Path | None
    motifs: str | None
    pin: tuple[str, ...]
    ban: tuple[str, ...]
    keep: tuple[str, ...]
    swap: tuple[str, ...]
    vary: tuple[str, ...]
    repeat: tuple[str, ...]
    existing: Path | None
    engine: str | None
    seed: int | None
    fps: float | None
    weight: tuple[str, ...]
    assigned: tuple[str, ...]
    config: str | None

    @property
    def edits_dance(self) -> bool:
        """Whether an existing dance is edited. Otherwise, parts of it are kept, if there is one."""
        return self.existing is not None and not self.keep

    def edits(self, times: SongTimes) -> list[EditRequest]:
        """The edits of an existing dance. Raises `ParameterError` for text that is none."""
        from choreograph.choreography.constraints import parse_ban, parse_pin
        from choreograph.choreography.edits import parse_repeat, parse_swap, parse_vary

        def read(given: tuple[str, ...], parse: Callable[[str], EditRequest]) -> list[EditRequest]:
            return [parse(text) for text in times.texts(given, None, None)]

        return [
            *map(parse_ban, self.ban), *read(self.swap, parse_swap), *read(self.vary, parse_vary),
            *read(self.repeat, parse_repeat), *read(self.pin, parse_pin),
        ]  # fmt: skip

    def times(self, song: Path, repertoire: Repertoire) -> SongTimes:
        """The places of a song that options may name."""
        return SongTimes(song, repertoire, genre=self.genre, beats=self.beats, existing=self.existing)

    def arguments(self, repertoire: Repertoire, times: SongTimes) -> DanceArguments:
        """The keywords of `dance`. `times` are those of the song.

        Raises `ParameterError` for text that is not a constraint, setting or weight, and `FormatError` for a
        file that cannot be read.
        """
        from choreograph.choreography.constraints import parse_ban, parse_keep, parse_pin, read_signature

        start_s = times.start_s(self.start)
        pins, keep = (times.texts(given, start_s, self.duration) for given in (self.pin, self.keep))
        arguments: dict[str, Any] = {
            "genre": self.genre,
            "signature": read_signature(self.signature) if self.signature else None,
            "motifs": _motifs(self.motifs, repertoire) if self.motifs else (),
            "pins": tuple(parse_pin(text) for text in pins),
            "bans": tuple(parse_ban(text) for text in self.ban),
            "keep": tuple(parse_keep(text) for text in keep),
            "existing": self.existing,
            "start_s": start_s,
            "duration_s": self.duration,
            **self._settings(),
        }
        if self.config is not None:
            published = self.config == PUBLISHED
            arguments["config"] = (
                _published(self.engine or "graph", repertoire) if published else load_config(self.config)
            )
        return arguments  # type: ignore[return-value]  # by name, as `DanceArguments` has them

    def _settings(self) -> dict[str, Any]:
        """The settings that were given as options or with --set."""
        options = {name: getattr(self, name) for name in ("beats", "engine", "seed", "fps")}
        options["weights"] = _weights(self.weight) or None
        return given_settings(DanceConfig, options, self.assigned)


def _published(engine: str, repertoire: Repertoire) -> DanceConfig:
    """The settings as published. Raises `RepertoireError` if the rollout networks they need are missing."""
    from choreograph.library.schema import rollout_names
    from choreograph.pipeline.published import published_dance

    config, names = published_dance(engine), rollout_names(repertoire.net_names)
    if engine == "rollout" and (not names or "rollout" in names):
        got = "one that was trained otherwise: use --set motif_draw=absolute for equation 5 alone"
        raise RepertoireError(
            f"{repertoire.path}: expected rollout networks of `choreograph build-db --published --rollout`, "
            f"got {got if names else 'none'}"
        )
    return config


def _motifs(text: str, repertoire: Repertoire) -> Any:
    """The motifs in a .json file, else those of a take or motion file."""
    from choreograph.choreography.constraints import read_motifs
    from choreograph.pipeline.session import motifs_of

    return read_motifs(text) if text.lower().endswith(".json") else motifs_of(text, repertoire)


def _weights(given: tuple[str, ...]) -> dict[str, float]:
    weights: dict[str, float] = {}
    for text in given:
        name, equals, number = (part.strip() for part in text.partition("="))
        try:
            weight = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise ParameterError(f"expected --weight COST=NUMBER, got {text!r}")
        if name in weights:
            raise ParameterError(f"expected the weight of {name} once, got several")
        weights[name] = weight
    return weights
