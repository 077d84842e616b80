"""Pictures of a dance at several times on one sheet, and plots of a repertoire's motifs, as PNGs.

The plots are signatures, transitions, distances to templates, and strips of the poses of motifs. They need
the extra `plots` (matplotlib).
"""

from __future__ import annotations

import colorsys
import logging
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from choreograph.core.errors import ParameterError
from choreograph.core.files import atomic_path, ends_of, free_names
from choreograph.core.numerics import Floats, chi_square_distance
from choreograph.core.progress import counted
from choreograph.formats.writer import DANCE_GENERATOR, GENERATOR
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import ALL_GENRES, Vocabulary, signature
from choreograph.motion.body import body_pos_m, ground_pos_m, heading_rad
from choreograph.motion.motion import Motion
from choreograph.view.renderer import Pixels, shots_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_COLUMNS = 8
_BAR = 0.085  # height of the bar of a label over the width of a tile
_BAR_RGB, _TEXT_RGB = (62, 70, 92), (240, 238, 233)
_GAP_PX = 2
_MAX_PIXELS = 200_000_000


def write_strip(
    path: str | Path,
    motion: Motion,
    times_s: Sequence[float],
    *,
    labels: Sequence[str] | None = None,
    columns: int | None = None,
    tile: tuple[int, int] = (240, 320),
    front_rad: float = 0.0,
    others: Sequence[Motion] = (),
) -> None:
    """Write the poses at `times_s` as one PNG with `columns` in a row (8, or fewer if there are fewer poses).

    The camera stands with the audience, in the direction `front_rad`, 0 for +Z. `labels`, one for each pose,
    are the times by default. `tile` is the size of one pose in pixels. `others` are further dancers of a
    scene, who are shown together.

    Raises `ParameterError` if there is no time, a time is outside of the motion, labels do not match, the
    sheet would be empty or larger than 200 megapixels, or the folder is missing. Raises `ChoreographError` if
    the file cannot be written.
    """
    sheet = draw_strip(
        motion, times_s, labels=labels, columns=columns, tile=tile, front_rad=front_rad, others=others
    )
    about = PngInfo()
    about.add_text("Software", DANCE_GENERATOR)
    with atomic_path(path) as temporary:
        Image.fromarray(sheet).save(temporary, format="PNG", pnginfo=about)


def draw_strip(
    motion: Motion,
    times_s: Sequence[float],
    *,
    labels: Sequence[str] | None = None,
    columns: int | None = None,
    tile: tuple[int, int] = (240, 320),
    front_rad: float = 0.0,
    others: Sequence[Motion] = (),
) -> Pixels:
    """The contact sheet of `write_strip`, (H, W, 3)."""
    if labels is None:
        labels = [f"{time:.2f} s" for time in times_s]
    n_poses = len(times_s)
    columns = min(_COLUMNS, n_poses) if columns is None else columns
    if len(labels) != n_poses:
        raise ParameterError(f"expected a label for each of {n_poses} poses, got {len(labels)}")
    if min(*tile, columns, n_poses) < 1:
        raise ParameterError(f"expected poses, columns and pixels, got {n_poses}, {columns} and {tile}")
    width, height = tile
    bar = round(_BAR * width)
    rows = -(-n_poses // columns)
    step_y, step_x = height + bar + _GAP_PX, width + _GAP_PX
    if rows * step_y * columns * step_x > _MAX_PIXELS:
        raise ParameterError(f"a sheet of {n_poses} poses of {width} x {height} pixels is too large")
    shots = shots_of((motion, *others), times_s, aspect=width / height, front_rad=front_rad)
    sheet = np.full((rows * step_y - _GAP_PX, columns * step_x - _GAP_PX, 3), 255, np.uint8)
    for index, label in enumerate(labels):
        y, x = index // columns * step_y, index % columns * step_x
        sheet[y : y + height, x : x + width] = shots.render(index, tile)
        sheet[y + height : y + height + bar, x : x + width] = _label(label, width, bar)
    return sheet


def _label(text: str, width: int, height: int) -> Pixels:
    bar = Image.new("RGB", (width, height), _BAR_RGB)
    if height >= 4:
        font = ImageFont.load_default(size=0.72 * height)
        ImageDraw.Draw(bar).text((width / 2, height / 2), text, fill=_TEXT_RGB, font=font, anchor="mm")
    return np.asarray(bar)


# Distances of takes to the template of their genre.


# Distances of takes to the template of their genre.


def dances_of(vocabulary: Vocabulary, take_genres: Sequence[str], genre: str) -> list[int]:
    """The takes with words of a genre, or of any for `ALL_GENRES`. `take_genres` has one genre per take."""
    danced = np.unique(vocabulary.word_take)
    return [int(take) for take in danced if genre in (ALL_GENRES, take_genres[take])]


def distances_to_template(vocabulary: Vocabulary, genre: str, takes: Sequence[int]) -> Floats:
    """χ² distances (X,) of the signatures of takes to the template of a genre.

    The template is the mean of these signatures, so that the only take of a genre is at distance 0. Raises
    `ParameterError` for an unknown genre or a take without words.
    """
    template = vocabulary.signatures[vocabulary.genre_index(genre)]
    dances = [vocabulary.word_motif[vocabulary.words_of_take(take)] for take in takes]
    return np.array([chi_square_distance(signature(d, vocabulary.n_motifs), template) for d in dances])


def distance_over_time(vocabulary: Vocabulary, genre: str, take: int) -> tuple[Floats, Floats]:
    """Seconds (N,) and the χ² distance (N,) of the signature up to then to the template of the genre.

    There is one value after each word of the take (Rhythm is a Dancer, Figure 12).
    """
    words = vocabulary.words_of_take(take)
    counts = np.cumsum(np.eye(vocabulary.n_motifs)[vocabulary.word_motif[words]], axis=0)  # (N, K)
    so_far = counts / np.arange(1, len(words) + 1)[:, None]
    seconds = vocabulary.word_end_s[words] - vocabulary.word_start_s[words[:1]]
    return seconds, chi_square_distance(so_far, vocabulary.signatures[vocabulary.genre_index(genre)])


# Pose strips of a motif.


WORDS_SHOWN = 4
_POSES = 3  # of a word
_FPS = 1.0  # of the poses of a strip, any rate


@dataclass(frozen=True, eq=False)
class ShownWord:
    """A motion word within its motion."""

    caption: str
    motion: Motion
    start_s: float  # in that motion
    end_s: float


def words_to_show(vocabulary: Vocabulary, motif: int, n_words: int = WORDS_SHOWN) -> NDArray[np.int64]:
    """The medoid of a motif and random words of its cluster, with a fixed seed, (n,), n ≤ `n_words`.

    Each is from another take. There are fewer if fewer takes contain the motif.
    """
    words = np.random.default_rng(motif).permutation(vocabulary.words_of_motif(motif))
    words = np.concatenate([vocabulary.motifs.words[motif : motif + 1], words])
    _, first = np.unique(vocabulary.word_take[words], return_index=True)
    return words[np.sort(first)[:n_words]]


def write_motif_strip(
    path: str | Path, words: Sequence[ShownWord], *, tile: tuple[int, int] = (160, 220)
) -> None:
    """Write a PNG with a row for each word: its first, middle and last pose, centred and facing the front.

    Raises errors as `view.strip.write_strip` does.
    """
    poses = [_poses(word) for word in words]
    row = Motion(
        poses[0].skeleton,
        np.concatenate([part.root_pos_m for part in poses]),
        np.concatenate([part.local_quat for part in poses]),
        _FPS,
    )
    captions = [text for word in words for text in (word.caption, f"{word.end_s - word.start_s:.2f} s", "")]
    write_strip(
        path, row, (np.arange(row.n_frames) / _FPS).tolist(), labels=captions, columns=_POSES, tile=tile
    )


def _poses(word: ShownWord) -> Motion:
    at_s = np.linspace(word.start_s, word.end_s, _POSES)
    poses = word.motion.sampled(np.minimum(at_s * word.motion.fps, word.motion.n_frames - 1))
    body = body_pos_m(poses)
    poses = poses.moved(shift_m=-ground_pos_m(body).mean(axis=0))
    return poses.moved(yaw_rad=-float(heading_rad(body[_POSES // 2])))


# Plots, after Figures 3 and 12 of Rhythm is a Dancer. They need the extra `plots` (matplotlib).


_LOG = logging.getLogger(__name__)
MOTIFS_SHOWN = 20  # as in Figure 3
STRIPS = 12
_TAKES_SHOWN = 3  # below a template: the nearest, the middle one and the farthest
_DPI = 110
_GOLDEN = 0.618034  # turns of hue between motifs, so that neighbours differ
_PANEL_COLUMNS = 3  # of panels
_NAME_CHARACTERS = 40  # of a genre in the name of a file
_MEAN_POINTS = 200


def write_motif_plots(folder: str | Path, repertoire: Repertoire) -> list[Path]:
    """Write all plots into `folder`, which is created if missing. Return the files.

    They are `signature-GENRE.png`, `transitions-GENRE.png`, `distance-over-time.png`, and `motif-NUMBER.png`
    for the most frequent motifs. If one of them exists and is from another program, all get other names,
    which is logged. Raises `ParameterError` if matplotlib is missing or the folder cannot be created,
    `RepertoireError` if the repertoire has no motion words.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise ParameterError(
            "expected matplotlib for plots, found none: install the extra 'plots'"
        ) from error
    folder, vocabulary = Path(folder), repertoire.vocabulary
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ParameterError(f"cannot create the folder {folder}: {error.strerror}") from error
    names = [take.name for take in repertoire.takes]
    take_genres = [take.credits.genre for take in repertoire.takes]
    dances = {genre: dances_of(vocabulary, take_genres, genre) for genre in vocabulary.genres}
    # A genre of the vocabulary need not have takes, and all genres together are shown where no other is.
    one_genre = {genre: takes for genre, takes in dances.items() if takes and genre != ALL_GENRES}
    dances = one_genre or {ALL_GENRES: dances[ALL_GENRES]}
    motifs = range(min(STRIPS, vocabulary.n_motifs))
    names_of = [re.sub(r"[^\w-]", "_", genre[:_NAME_CHARACTERS]) for genre in dances]
    usual = [f"{kind}-{name}.png" for name in names_of for kind in ("signature", "transitions")]
    usual += ["distance-over-time.png", *(f"motif-{motif:03d}.png" for motif in motifs)]
    written = free_names((folder / name for name in usual), _is_of_another_program)
    if written[0].name != usual[0]:
        _LOG.warning("%s has other files of these names: the first plot is %s", folder, written[0].name)
    paths = iter(written)
    for genre, takes in dances.items():
        _save(signature_figure(vocabulary, genre, takes, names), next(paths))
        _save(transitions_figure(vocabulary, genre), next(paths))
    _save(distance_figure(vocabulary, dances), next(paths))
    for motif, path in zip(motifs, paths, strict=True):
        write_motif_strip(path, [_shown(repertoire, word) for word in words_to_show(vocabulary, motif)])
    return written


def _is_of_another_program(path: Path) -> bool:
    """Whether a file exists that this program did not write."""
    return os.path.lexists(path) and GENERATOR.split()[0].encode() not in ends_of(path)


def signature_figure(vocabulary: Vocabulary, genre: str, takes: list[int], names: list[str]) -> Figure:
    """The template over its most frequent motifs, and the signatures of three of its takes below."""
    template = vocabulary.signatures[vocabulary.genre_index(genre)]
    motifs = np.argsort(-template, kind="stable")[:MOTIFS_SHOWN]
    distances = distances_to_template(vocabulary, genre, takes)
    order = np.argsort(distances, kind="stable")
    chosen = order[np.unique(np.linspace(0, len(order) - 1, _TAKES_SHOWN).round().astype(int))]
    figure = _figure(9.0, 1.9 * (1 + len(chosen)))
    axes = figure.subplots(1 + len(chosen), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    _bars(axes[0], template, motifs)
    axes[0].set_title(
        f"{genre}: template of {counted(len(takes), 'take')}, {template[motifs].sum():.0%} in these motifs",
        loc="left",
    )
    for axis, index in zip(axes[1:], chosen, strict=True):
        words = vocabulary.words_of_take(takes[index])
        _bars(axis, signature(vocabulary.word_motif[words], vocabulary.n_motifs), motifs)
        axis.set_title(f"{names[takes[index]]}: χ² distance {distances[index]:.2f}", loc="left")
    axes[-1].set_xticks(range(len(motifs)), [str(m) for m in motifs])
    axes[-1].set_xlabel("motif")
    return figure


def transitions_figure(vocabulary: Vocabulary, genre: str) -> Figure:
    """Transition probabilities between the most frequent motifs of a genre."""
    row = vocabulary.genre_index(genre)
    motifs = np.argsort(-vocabulary.signatures[row], kind="stable")[:MOTIFS_SHOWN]
    figure = _figure(7.6, 6.6)
    axis = figure.subplots()
    image = axis.imshow(vocabulary.transitions[row][np.ix_(motifs, motifs)], cmap="magma_r", vmin=0.0)
    axis.set_xticks(range(len(motifs)), [str(m) for m in motifs], rotation=90)
    axis.set_yticks(range(len(motifs)), [str(m) for m in motifs])
    axis.set_xlabel("next motif")
    axis.set_ylabel("motif")
    axis.set_title(f"{genre}: transitions between its {len(motifs)} most frequent motifs", loc="left")
    figure.colorbar(image, ax=axis, label="probability", fraction=0.046)
    return figure


def distance_figure(vocabulary: Vocabulary, dances: dict[str, list[int]]) -> Figure:
    """χ² distance of every take to the template of its genre over time, with a panel for each genre."""
    columns = min(_PANEL_COLUMNS, len(dances))
    rows = -(-len(dances) // columns)
    figure = _figure(1.5 + 3.6 * columns, 0.6 + 2.8 * rows)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axis, (genre, takes) in zip(panels.flat, dances.items(), strict=False):
        curves = [distance_over_time(vocabulary, genre, take) for take in takes]
        for seconds, distance in curves:
            axis.plot(seconds, distance, color="#8a93a8", linewidth=0.8, alpha=0.7)
        # After the end of the middle take the mean would jump whenever one of the remaining takes ends.
        until_s = sorted(seconds[-1] for seconds, _ in curves)[len(curves) // 2]
        at_s = np.linspace(min(seconds[0] for seconds, _ in curves), until_s, _MEAN_POINTS)
        mean = [np.mean([np.interp(s, *c) for c in curves if c[0][-1] >= s]) for s in at_s]
        axis.plot(at_s, mean, color="#c1272d", linewidth=1.8, label="mean")
        axis.set_title(f"{genre}: {counted(len(takes), 'take')}", loc="left")
        axis.tick_params(labelbottom=True)
        axis.set_ylim(0.0, 1.0)
        axis.set_xlim(left=0.0)
        axis.grid(alpha=0.25)
    for axis in panels.flat[len(dances) :]:
        axis.set_axis_off()
    panels[0, 0].legend(frameon=False)
    figure.supxlabel("seconds danced")
    figure.supylabel("χ² distance to the template of the genre")
    return figure


def _bars(axis: Axes, shares: Floats, motifs: NDArray[np.int64]) -> None:
    colours = [colorsys.hls_to_rgb(motif * _GOLDEN % 1.0, 0.52, 0.55) for motif in motifs]
    axis.bar(range(len(motifs)), 100.0 * shares[motifs], color=colours, width=0.8)
    axis.set_ylabel("% of words")
    axis.spines[["top", "right"]].set_visible(False)


def _shown(repertoire: Repertoire, word: int) -> ShownWord:
    vocabulary = repertoire.vocabulary
    take = int(vocabulary.word_take[word])
    start_s, end_s = float(vocabulary.word_start_s[word]), float(vocabulary.word_end_s[word])
    motion, first_s = repertoire.motion(take, start_s, end_s)
    return ShownWord(repertoire.takes[take].name, motion, start_s - first_s, end_s - first_s)


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=_DPI, layout="constrained")


def _save(figure: Figure, path: Path) -> None:
    with atomic_path(path) as temporary:
        figure.savefig(temporary, metadata={"Software": GENERATOR})
