"""What commands read, write and change, and what their options affect: declared once, with each parameter.

The type of a parameter says which files its value names: an `Input` is read, an `Output` is written, and
what is `Changed` is both. Paths inside texts, such as `bar 9=FILE`, are inputs, too. A parameter also says
in which modes of its command it is used (`modes`), which mode it selects (`selects`), which other parameter
it needs (`needs`), and which option of a saved dance it is (`saves`).

From these declarations, `Command` derives all checks before a command runs: no output is an input or another
output, no input is larger than what is read of its kind, and no option is ignored. The help lists the formats
that `formats` declares, and the tests try all pairs of inputs and outputs.

Times are in seconds, as on a clock, or places of a song such as `bar 9` or `chorus 2` (`SongTimes`).
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click
from click.core import ParameterSource
from click_option_group import GroupedOption, optgroup

from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.files import check_apart, read_json, read_text
from choreograph.core.settings import from_texts
from choreograph.core.timebase import parse_seconds
from choreograph.formats import formats_using, motion_formats, output_formats

if TYPE_CHECKING:
    from choreograph.library.repertoire import Repertoire
    from choreograph.music.song_features import Places
    from choreograph.plan.plan import Plan

    _Floats = click.ParamType[float]
else:
    _Floats = click.ParamType  # not generic in every click

# The files that values name.

Given = Mapping[str, Any]  # the values of all parameters of a command, by name


def whole(text: str) -> str:
    """A text that is a name or a path."""
    return text


def local(text: str) -> str:
    """A path, unless the text is an address such as s3://bucket/takes."""
    return "" if "://" in text else text


def after_at(text: str) -> str:
    """The path in @FILE."""
    return text[1:] if text.startswith("@") else ""


def after_equals(text: str) -> str:
    """The path in NAME=FILE, or in FILE alone."""
    return text.rpartition("=")[2].strip()


class Input(click.Path):
    """A file or folder that a command reads.

    `kind` says what is in it, such as a "song" or a "plan". `inside` returns the path that a text may
    contain, or an empty text. Without it, the whole value is a path. How large files may be is in
    `core.files`.
    """

    def __init__(self, kind: str, inside: Callable[[str], str] | None = None) -> None:
        super().__init__(path_type=Path)
        self.kind, self.inside = kind, inside

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path, or the unchanged text that may contain one."""
        is_path = self.inside is None or (self.inside is local and local(str(value)))
        return super().convert(value, param, ctx) if is_path else value

    def files(self, value: str | Path) -> Iterator[Path]:
        """The existing files and folders that a value names, and what is read with them."""
        named = value if self.inside is None else self.inside(str(value))
        if named and os.path.exists(named):
            yield Path(named)
            if self.kind in _READ_WITH:
                yield from _READ_WITH[self.kind](Path(named))


class Changed(Input):
    """A file or folder that a command reads and then replaces or adds to, or one that it makes.

    `when` returns whether it is changed, by all parameters of the command. Otherwise it is an input.
    """

    def __init__(
        self,
        kind: str,
        inside: Callable[[str], str] | None = None,
        when: Callable[[Given], bool] = lambda _: True,
        default: Callable[[Given], Iterable[Path]] | None = None,
    ) -> None:
        super().__init__(kind, inside)
        self.when, self.default = when, default


class Output(click.Path):
    """A file that a command writes, or a folder in which it writes files.

    `written` returns the files that are written for a path: by default the path, and none for -, which is
    standard output. `default` returns the paths where none is given. Commands take other names instead of
    those of inputs and of files of others.
    """

    def __init__(
        self,
        written: Callable[[Path, Given], Iterable[Path]] | None = None,
        default: Callable[[Given], Iterable[Path]] | None = None,
    ) -> None:
        super().__init__(path_type=Path)
        self._written, self.default = written, default

    def files(self, path: Path, given: Given) -> Iterable[Path]:
        """The files that are written for a path."""
        if self._written is not None:
            return self._written(path, given)
        return () if is_stdout(path) else (path,)


def is_stdout(path: Path | None) -> bool:
    """Whether an output is -, which is standard output."""
    return path == Path("-")


def _beside_motion(path: Path) -> Iterator[Path]:
    """The counts of a motion, the song of its name, and the files that a .gltf refers to."""
    from choreograph.formats.folder import SongsByName
    from choreograph.formats.register import read_beside

    yield from read_beside(path)
    song = SongsByName.in_folder(path.parent).of(path.stem) if path.is_file() else None
    if song is not None and song != path:
        yield song


def _kept_by_plan(path: Path) -> Iterator[Path]:
    """The motion file beside a plan that keeps parts of it."""
    if path.suffix.lower() != ".json":
        return
    with suppress(ChoreographError):  # its reader says what is wrong
        data = read_json(path, "a plan")
        words = data.get("words") if isinstance(data, dict) else None
        kept = {word.get("kept") for word in words or () if isinstance(word, dict)}
        beside = [path.with_name(Path(name).name) for name in kept if isinstance(name, str) and name]
        yield from filter(os.path.isfile, beside)


def _named_by_config(path: Path) -> Iterator[Path]:
    """The files that settings in a TOML file name."""
    with suppress(ChoreographError, ValueError, RecursionError):
        named = tomllib.loads(read_text(path, "a config (TOML)")).values()
        yield from (Path(name) for name in named if isinstance(name, str) and os.path.isfile(name))


# By the kind of an input, the other files that are read with it.
_READ_WITH: dict[str, Callable[[Path], Iterator[Path]]] = {
    "motion": _beside_motion, "takes": _beside_motion, "character": _beside_motion, "plan": _kept_by_plan,
    "config": _named_by_config,
}  # fmt: skip


# What options affect.


Written = Literal["dances", "scenes", "motions"]  # what a command writes


class Declared:
    """A parameter that says what it affects. See the top of the module."""

    def __init__(
        self,
        *args: Any,
        modes: Sequence[str] = (),
        selects: str = "",
        needs: str = "",
        saves: str = "",
        **attrs: Any,
    ) -> None:
        super().__init__(*args, **attrs)
        self.modes, self.selects, self.needs, self.saves = tuple(modes), selects, needs, saves


class Option(Declared, click.Option):
    """An option. Its help ends with the formats that it affects, or with what `completed` returns."""

    def __init__(
        self,
        *args: Any,
        written: Written = "dances",
        completed: Callable[[], str] | None = None,
        **attrs: Any,
    ) -> None:
        super().__init__(*args, **attrs)
        self._completed = completed or (partial(_formats_of, self.saves, written) if self.saves else None)

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """The flags and the help."""
        if self._completed is not None:
            self.help, self._completed = f"{self.help} {self._completed()}", None
        return super().get_help_record(ctx)


def _formats_of(saves: str, written: Written) -> str:
    """The formats that an option of a saved dance affects, or those that it does not, if these are fewer."""
    known = motion_formats() if written == "motions" else output_formats()
    used = [format for format in formats_using(saves, in_scenes=written == "scenes") if format in known]
    others = [format for format in known if format not in used]
    if len(others) < len(used):
        return f"Not in {_suffixes(others, 'or')}."
    return f"In {_suffixes(used, 'or')}."


class _Grouped(Option, GroupedOption):
    """An option in a group of the help."""


class _Argument(Declared, click.Argument):
    """An argument."""


option = partial(click.option, cls=Option)
grouped = partial(optgroup.option, cls=_Grouped)
argument = partial(click.argument, cls=_Argument)


class Command(click.Command):
    """A command whose checks follow from what its parameters declare.

    `reasons` has, for some of the modes that parameters select, why they do not use all options. The mode ""
    is that in which nothing is selected.
    """

    def __init__(self, *args: Any, reasons: Mapping[str, str] | None = None, **attrs: Any) -> None:
        super().__init__(*args, **attrs)
        self._reasons = reasons or {}

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does. Raises `ParameterError` for a repeated option that may be given once."""
        _, _, given = self.make_parser(ctx).parse_args(list(args))
        for option in given:
            repeatable = not isinstance(option, click.Option) or option.multiple or option.count
            if not repeatable and given.count(option) > 1:
                raise ParameterError(f"expected {flag_of(option)} once, got it {given.count(option)} times")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command, unless a check raises `ParameterError`: see the top of the module."""
        check_apart(outputs(), inputs())
        self._check_used(ctx)
        return super().invoke(ctx)

    def mode(self, ctx: click.Context) -> str:
        """The mode that the parameters select. Raises `ParameterError` if they select several."""
        found = {
            param.selects: flag_of(param)
            for param in given_parameters(ctx)
            if isinstance(param, Declared) and param.selects
        }
        if len(found) > 1:
            flags = list(found.values())
            raise ParameterError(f"expected one of {', '.join(flags)}, got {' and '.join(flags)}")
        return next(iter(found), "")

    def _check_used(self, ctx: click.Context) -> None:
        """Raise `ParameterError` for a given parameter that the mode does not use, or that needs another."""
        given, mode = given_parameters(ctx), self.mode(ctx)
        names = {param.name for param in given}
        for param in given:
            if not isinstance(param, Declared):
                continue
            if param.modes and mode not in param.modes:
                where = (
                    f"beside {self._selecting(mode)}" if mode else f"without {self._selecting(*param.modes)}"
                )
                why = f", which {self._reasons[mode]}" if mode in self._reasons else ""
                raise ParameterError(f"expected no {flag_of(param)} {where}{why}: leave it out")
            if param.needs and param.needs not in names:
                other = next(one for one in self.params if one.name == param.needs)
                raise ParameterError(f"expected {flag_of(other)} beside {flag_of(param)}, got none")

    def _selecting(self, *modes: str) -> str:
        """The flags that select one of the modes."""
        flags = [flag_of(one) for one in self.params if isinstance(one, Declared) and one.selects in modes]
        return _listed(list(dict.fromkeys(flags)), "or")


def given_parameters(ctx: click.Context) -> list[click.Parameter]:
    """The parameters that the user gave to a command, in the order of its help."""
    return [
        param
        for param in ctx.command.params
        if param.name is not None
        and ctx.get_parameter_source(param.name) is ParameterSource.COMMANDLINE
        and ctx.params.get(param.name) not in ((), None)
    ]


def flag_of(param: click.Parameter) -> str:
    """What the user writes for a parameter: the longest flag of an option, or the name of an argument."""
    if isinstance(param, click.Option):
        return max(param.opts, key=len)
    return (param.metavar or str(param.name).upper()).strip("[].")


# What follows for the files of a command.


def inputs() -> list[Path]:
    """The existing files and folders that the running command reads and does not change."""
    return [
        path
        for kind, value in _named_files(click.get_current_context())
        if isinstance(kind, Input) and not _is_changed(kind)
        for path in kind.files(value)
    ]


def outputs() -> list[Path]:
    """The files that the running command writes or changes, beside those of default names."""
    context = click.get_current_context()
    found: list[Path] = []
    for kind, value in _named_files(context):
        if isinstance(kind, Output):
            found += kind.files(value, context.params)
        elif _is_changed(kind):
            found.append(Path(value))
    return found


def default_outputs() -> list[Path]:
    """The files that the running command writes or changes where none is given."""
    context = click.get_current_context()
    return [
        path
        for param in context.command.params
        if isinstance(param.type, Output | Changed) and param.type.default is not None
        if not context.params.get(param.name or "")
        for path in param.type.default(context.params)
    ]


def _named_files(ctx: click.Context) -> Iterator[tuple[Input | Output, Any]]:
    """The values of parameters that name files, one by one, with their types."""
    for param in ctx.command.params:
        value = ctx.params.get(param.name or "")
        if isinstance(param.type, Input | Output) and value is not None:
            yield from ((param.type, one) for one in (value if isinstance(value, tuple) else (value,)))


def _is_changed(kind: Input | Output) -> bool:
    return isinstance(kind, Changed) and kind.when(click.get_current_context().params)


def unused_options(outputs: Sequence[Path], *, in_scenes: bool = False) -> tuple[str, ...]:
    """A note on the options that some of the files do not use, or none if all files use all of them.

    Raises `ParameterError` for an option that no file uses, and for a character together with USD files,
    which would contain the mannequin.
    """
    formats = list(dict.fromkeys(path.suffix.lower().removeprefix(".") for path in outputs))
    without: dict[tuple[str, ...], list[str]] = {}  # formats -> flags that have no effect on them
    for flag, saves in _saving(click.get_current_context()):
        users = formats_using(saves, in_scenes=in_scenes)
        unused = tuple(format for format in formats if format not in users)
        if len(unused) == len(formats):
            raise ParameterError(
                f"expected {_suffixes(users, 'or')} for {flag}, got {_suffixes(formats, 'and')}: add -o "
                f"NAME.{users[0]}"
            )
        if saves == "character" and {"usda", "usdc"} & set(unused):
            raise ParameterError(
                f"expected no USD file with {flag}, got one: characters are only written to "
                f"{_suffixes(users, 'and')}"
            )
        if unused:
            without.setdefault(unused, []).append(flag)
    parts = []
    for others, useless in without.items():
        verb = "have" if len(useless) > 1 else "has"
        parts.append(f"{_listed(useless, 'and')} {verb} no effect on {_suffixes(others, 'and')}")
    return ("; ".join(parts),) if parts else ()


def _saving(ctx: click.Context) -> Iterator[tuple[str, str]]:
    """The given options of saved dances, and what they are: also those that --set names."""
    declared = [param for param in ctx.command.params if isinstance(param, Declared) and param.saves]
    given = given_parameters(ctx)
    assigned = {text.partition("=")[0].strip() for text in ctx.params.get("assigned", ())}
    for param in declared:
        if param in given:
            yield flag_of(param), param.saves
        elif param.name in assigned:
            yield f"--set {param.name}", param.saves


def _suffixes(formats: Sequence[str], word: str) -> str:
    return _listed([f".{format}" for format in formats], word)


def _listed(items: Sequence[str], word: str) -> str:
    return f" {word} ".join(part for part in (", ".join(items[:-1]), items[-1]) if part)


# What texts stand for.


def given_settings(cls: type, options: Mapping[str, Any], assigned: Sequence[str]) -> dict[str, Any]:
    """The settings of a class that were given by options, which are then not None, or by --set.

    Raises `ParameterError` for one that was given both ways, and as `core.settings.from_texts`.
    """
    given = {name: value for name, value in options.items() if value is not None}
    values = from_texts(cls, assigned)
    for name in sorted(set(given) & set(values)):
        raise ParameterError(f"expected {name} once, got --{name.replace('_', '-')} and --set {name}")
    return {**given, **values}


def names_of(given: tuple[str, ...]) -> tuple[str, ...]:
    """The names given, each @FILE replaced by the names in it. Raises `FormatError` if one cannot be read."""
    names: list[str] = []
    for name in given:
        path = after_at(name)
        if not path:
            names.append(name)
            continue
        lines = read_text(path, "a list of names").splitlines()
        names += [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    return tuple(names)


# Times.


class Seconds(_Floats):
    """A time, in seconds (`75.5`) or with minutes and hours (`1:15.5`)."""

    name = "seconds"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The time in seconds. Reports a value that is no time as click does."""
        try:
            return parse_seconds(value) if isinstance(value, str) else float(value)
        except ParameterError as error:
            self.fail(str(error), param, ctx)


class SongTime(Seconds):
    """A time in a song: in seconds, as on a clock, or the start of a place such as `chorus 2`."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The time in seconds, or the text that names a place, which needs the song."""
        from choreograph.music.song_features import names_place

        if isinstance(value, str) and names_place(value):
            return value
        return super().convert(value, param, ctx)


class SongTimes:
    """The places of one song, which is analysed when a text first names one.

    Texts are those of options. `genre` and `beats` are the options that the analysis depends on.
    """

    def __init__(
        self,
        song: Path,
        repertoire: Repertoire,
        *,
        genre: str | None,
        beats: str | None,
        existing: Path | None,
    ) -> None:
        self._song, self._repertoire, self._existing = song, repertoire, existing
        self._genre, self._beats = genre, beats

    def start_s(self, start: float | str | None) -> float | None:
        """The time in the song at which a dance begins."""
        if not isinstance(start, str):
            return start
        return float(self._places(None, None).in_seconds(start))

    def texts(
        self, given: tuple[str, ...], start_s: float | None, duration_s: float | None
    ) -> tuple[str, ...]:
        """Options with times of the dance to a part of the song, in seconds."""
        return tuple(self._text(text, start_s, duration_s) for text in given)

    def _text(self, text: str, start_s: float | None, duration_s: float | None) -> str:
        from choreograph.music.song_features import names_place

        if not names_place(text):
            return text
        places = self._places(start_s, duration_s)
        span, at, time = text.partition("@")
        is_span = "=motif" not in text
        return places.in_seconds(span, is_span=is_span) + at + (places.in_seconds(time) if at else "")

    def _places(self, start_s: float | None, duration_s: float | None) -> Places:
        from choreograph.choreography.song_analysis import analyse_song
        from choreograph.library.songs import DEFAULT_BEATS
        from choreograph.music.song import load_song
        from choreograph.music.song_features import Places

        if self._plan is not None and start_s is None:
            start_s = self._plan.start_s
        if self._plan is not None and duration_s is None:
            duration_s = self._plan.duration_s
        part = load_song(self._song, start_s=start_s or 0.0, duration_s=duration_s)
        features, _ = analyse_song(
            part, self._repertoire, beats=self._beats or DEFAULT_BEATS, genre=self._genre, keep=True
        )
        return Places.of_song(features)

    @cached_property
    def _plan(self) -> Plan | None:
        """The plan of the existing dance, whose part of the song is danced, if there is one."""
        from choreograph.plan.plan import Plan

        is_plan = self._existing is not None and self._existing.suffix.lower() == ".json"
        return Plan.read(self._existing) if is_plan and self._existing is not None else None
