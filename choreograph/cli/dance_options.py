"""The options of `choreograph dance`, in the groups of its `--help`.

Settings have no default here, since the pipeline distinguishes those that were given. It raises an error for
those that the chosen engine does not use.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click_option_group import GroupedOption, optgroup

from choreograph.cli.characters import TARGET_NAMES
from choreograph.cli.present import Command, Seconds, given_options, given_settings
from choreograph.cli.times import SongTime, SongTimes
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.settings import DanceConfig, engine_names, load_config, published_dance

if TYPE_CHECKING:
    from choreograph.choreography.edits import EditRequest
    from choreograph.formats.targets import TargetName
    from choreograph.library.repertoire import Repertoire
    from choreograph.motion.cameras import CameraMode
    from choreograph.pipeline.dancing import DanceArguments

AnyCommand = TypeVar("AnyCommand", bound=Callable[..., Any])
Options = TypeVar("Options")
PUBLISHED = "published"  # instead of a file, for the settings of the paper of the engine
_FILE = click.Path(path_type=Path)
CAMERA_MODES: tuple[CameraMode, ...] = ("front", "follow", "cuts")
# Options that this command had, and that `convert` has.
_OF_CONVERT = ("--names", "--units", "--rest", "--in-place")


class DanceCommand(Command):
    """`choreograph dance`, which says what to write instead of options that it had."""

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


class _Planned(GroupedOption):
    """An option of the planning, which cannot be combined with --plan."""


_SOURCES = (
    optgroup.option(
        "--db", type=_FILE, multiple=True, metavar="FILE|DIR",
        help="Repertoire, or a folder of several. Repeatable. Default: the built-in one.",
    ),
    optgroup.option(
        "--start", cls=_Planned, type=SongTime(),
        help="Where in the song to begin: 75.5, 1:15.5, bar 9 or chorus 2 (0).",
    ),
    optgroup.option(
        "--duration", cls=_Planned, type=Seconds(), help="Length of the dance (to the end of the song)."
    ),
    optgroup.option(
        "--beats", cls=_Planned, metavar="network|tempo-path|librosa|beat-this|FILE",
        help="Beat tracker (network), or a text file with a beat on each line: its time in seconds and, if "
        "known, its number in the bar.",
    ),
)  # fmt: skip

_CONSTRAINTS = (
    optgroup.option("--genre", cls=_Planned, help="Genre to follow. Default: the nearest one to the song."),
    optgroup.option(
        "--signature", cls=_Planned, type=_FILE,
        help="Dance each motif as often as in this file. `inspect --signature` writes one.",
    ),
    optgroup.option(
        "--motifs", cls=_Planned, metavar="FILE|TAKE",
        help="Dance these motifs in this order: those of a plan, of a list (.json), of a take of the "
        "repertoire, or of a motion file.",
    ),
    optgroup.option(
        "--pin", cls=_Planned, multiple=True, metavar="SECOND=motif:N|FROM-TO=take:NAME",
        help="Dance this motif or take at this time. Repeatable, as the next five.",
    ),
    optgroup.option(
        "--ban", cls=_Planned, multiple=True, metavar="KIND:NAME",
        help="Never dance this: take, genre, performer, licence or motif, such as genre:tango.",
    ),
    optgroup.option(
        "--keep", cls=_Planned, multiple=True, metavar="FROM-TO",
        help="Keep this part of the existing dance, and plan the rest again.",
    ),
    optgroup.option(
        "--swap", cls=_Planned, multiple=True, metavar="FROM-TO",
        help="Dance something else in this part of the existing dance.",
    ),
    optgroup.option(
        "--vary", cls=_Planned, multiple=True, metavar="FROM-TO",
        help="Dance something similar in this part of the existing dance.",
    ),
    optgroup.option(
        "--repeat", cls=_Planned, multiple=True, metavar="FROM-TO@TIME[=mirror]",
        help="Dance this part of the existing dance, or its mirror image, again at a time.",
    ),
    optgroup.option(
        "--existing", type=_FILE,
        help="The dance to edit or to keep parts of: .bvh, .npz or a plan. Without --keep, pins and bans "
        "change only their time.",
    ),
    optgroup.option(
        "--strict", cls=_Planned, is_flag=True,
        help="Fail if a pin, ban or motif is not danced. Otherwise, a note is printed.",
    ),
    optgroup.option(
        "--plan", "plan_path", type=_FILE,
        help="Render this plan, edited or not. SONG is then only the sound of a page or video.",
    ),
)  # fmt: skip

_SETTINGS = (
    optgroup.option(
        "--engine", cls=_Planned, metavar="|".join(engine_names()),
        help="Join seconds of takes (graph, the default) or motion words of takes (mixer), or generate "
        "motion with a network (rollout).",
    ),
    optgroup.option("--seed", cls=_Planned, type=int, help="Another seed gives another dance (0)."),
    optgroup.option("--fps", cls=_Planned, type=float, help="Frames per second of the dance (60)."),
    optgroup.option(
        "--weight", cls=_Planned, multiple=True, metavar="COST=NUMBER",
        help="Weight of a cost of the graph engine, such as transition=8. 0 leaves it out. Repeatable. "
        "`choreograph settings weights` lists the costs.",
    ),
    optgroup.option(
        "--set", "assigned", cls=_Planned, multiple=True, metavar="NAME=VALUE",
        help="Any other setting, such as planner=greedy. Repeatable. `choreograph settings` lists them.",
    ),
    optgroup.option(
        "--config", cls=_Planned, metavar="FILE|published",
        help="TOML file of settings, or published, for those of the paper. Options and --set replace them.",
    ),
    optgroup.option(
        "--variations", cls=_Planned, type=int, metavar="N", help="Make N different dances, NAME-1.bvh to -N."
    ),
    optgroup.option(
        "--workers", type=int, metavar="N", help="Songs danced at once (1). 0: one a CPU core."
    ),
    optgroup.option(
        "--dask", metavar="ADDRESS",
        help="Dask scheduler whose workers dance the songs.",
    ),
)  # fmt: skip

_OUTPUT = (
    optgroup.option(
        "-o", "--output", multiple=True, type=_FILE,
        help="File to write. Repeatable. .bvh, .npz: motion. .glb, .fbx, .usda, .usdc: a body that moves. "
        ".vrma: for VRM avatars. .vmd: for MikuMikuDance. .html: a page to watch. .mp4: a video. .png: poses "
        "on the beats. .json: the plan. Default: SONG.bvh and SONG.html here. {song} stands for the song's "
        "name.",
    ),
    optgroup.option(
        "--character", type=_FILE, help="Character (.glb, .gltf, .vrm, .fbx) in an .html, .glb or .fbx."
    ),
    optgroup.option("--map", "map_path", type=_FILE, help="Bones of the character, edited (.json)."),
    optgroup.option("--save-map", type=_FILE, help="Write the bones that were found (.json)."),
    optgroup.option(
        "--camera", type=click.Choice(CAMERA_MODES),
        help="Film it from the audience, follow it, or cut on phrases (.html, .mp4, .glb, .usda).",
    ),
    optgroup.option(
        "--for", "target", type=click.Choice(TARGET_NAMES), metavar="PROGRAM",
        help=f"Program that a .glb or .vmd is for: {', '.join(TARGET_NAMES)}.",
    ),
    optgroup.option("--loop", is_flag=True, help="Cut motion files to whole bars that can be looped."),
    optgroup.option(
        "--click", "with_clicks", is_flag=True, help="Mix a click on each count into the video."
    ),
    optgroup.option(
        "--force", is_flag=True, help="Replace files that are not dances, if -o is not given."
    ),
    optgroup.option("--open", "opened", is_flag=True, help="Open the page in the browser."),
    optgroup.option(
        "--json", "as_json", is_flag=True,
        help="Print the results as JSON, and progress as lines on stderr: STAGE DONE/TOTAL.",
    ),
    optgroup.option("-q", "--quiet", is_flag=True, help="Print no progress, notes or summary."),
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


def check_options_with_plan(songs: tuple[Path, ...]) -> None:
    """Raise `ParameterError` if an option or a song is given that contradicts the plan."""
    if len(songs) > 1:
        raise ParameterError(f"expected one SONG beside --plan, got {len(songs)}")
    decided = given_options(of_kind=_Planned)
    if decided:
        raise ParameterError(f"--plan decides what is danced: leave out {', '.join(decided)}")


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
        """Whether an existing dance is edited. Raises `ParameterError` for options that contradict this."""
        named = {"--swap": self.swap, "--vary": self.vary, "--repeat": self.repeat}
        asked = [name for name, given in named.items() if given]
        if asked and (self.existing is None or self.keep):
            other = "--keep" if self.keep else "no --existing"
            raise ParameterError(
                f"expected --existing FILE beside {asked[0]}, and no --keep, since an edit keeps the rest, "
                f"got {other}"
            )
        if self.existing is None or self.keep or not (asked or self.pin or self.ban):
            return False
        used = ("--pin", "--ban", "--swap", "--vary", "--repeat", "--existing", "--seed", "--strict")
        unused = [name for name in given_options(of_kind=_Planned) if name not in used]
        if unused:
            raise ParameterError(
                f"expected no {unused[0]} for an edit of an existing dance, which has its own settings: "
                "leave it out, or give the parts to --keep"
            )
        return True

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
