"""`change_takes`, which adds takes to a repertoire, replaces some or removes some."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Unpack

from choreograph.core.arguments import as_list, as_texts, check_function
from choreograph.core.errors import ParameterError
from choreograph.core.files import as_path
from choreograph.core.numerics import default_numerics
from choreograph.core.progress import ProgressReport
from choreograph.core.settings import changed
from choreograph.library.building import growing
from choreograph.library.building.options import BuildOptions, BuildResult, ReadingSettings


@default_numerics()
def change_takes(
    repertoire: str | Path,
    *,
    add: str | Path | Iterable[str | Path] = (),
    replace: str | Path | Iterable[str | Path] = (),
    remove: Iterable[str] = (),
    output: str | Path | None = None,
    report: ProgressReport | None = None,
    **settings: Unpack[ReadingSettings],
) -> BuildResult:
    """Add takes to a repertoire file, replace some or remove some, without building it again.

    Only new takes are read, measured, counted and embedded. Networks and motifs are kept. The file is that of
    a build of all takes with these networks and motifs (`init_from` and `keep_networks` of `build`).

    Parameters
    ----------
    repertoire : the file, which is replaced as a whole at the end unless there is an `output`
    add : a folder or file of takes, or several. No take in the repertoire has their names
    replace : the same, of takes whose names are in the repertoire
    remove : names of takes
    output : the file to write instead
    report : called with the name of the stage, the work done so far, and all the work
    **settings : settings of `build` about the reading of sources: `leave_out`, `skip_bad`, `allow_outside`,
        `bone_map`, `workers`, `dask`, `stage` and `cache_gb`

    Returns the repertoire and what was unusual in the new takes. A note says how far they are from those that
    the networks were trained on.

    Raises
    ------
    ChoreographError  another process changes the file, or it cannot be written
    ParameterError    there is nothing to change, no take would be left, or a name does not fit
    FormatError       a source is damaged. If several are, it is an `UnreadFilesError` that names them
    RepertoireError   the repertoire cannot be read

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, stop_s=10)
    >>> cg.save_motion("walk.bvh", motion)
    >>> cg.save_motion("turn.bvh", motion)
    >>> built = cg.build("walk.bvh", "mine.h5", preset="tiny", words=False)
    >>> changed = cg.change_takes("mine.h5", add="turn.bvh", remove=["walk"])
    >>> [take.name for take in changed.repertoire.takes]
    ['turn']
    """
    changes = growing.TakeChanges(
        add=_sources("add", add),
        replace=_sources("replace", replace),
        remove=as_texts("remove", remove),
    )
    check_function("report", report)
    if unknown := sorted(set(settings) - set(ReadingSettings.__annotations__)):
        known = ", ".join(ReadingSettings.__annotations__)
        raise ParameterError(
            f"expected settings among {known}, since networks are kept, got {', '.join(unknown)}: build the "
            "repertoire again to change others"
        )
    options = changed(BuildOptions(), settings)
    target = None if output is None else as_path("the output", output)
    return growing.change_takes(as_path("a repertoire file", repertoire), changes, target, options, report)


def _sources(name: str, given: str | Path | Iterable[str | Path]) -> tuple[str | Path, ...]:
    paths = [given] if isinstance(given, str | Path) else given
    return tuple(as_list(name, paths, "paths", str | Path))
