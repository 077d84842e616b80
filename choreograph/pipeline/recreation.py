"""The motif sequence and the signature of an existing dance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.building.importing import measure_take
from choreograph.building.segmentation import segment_takes
from choreograph.errors import ParameterError
from choreograph.files import as_path
from choreograph.importers import import_takes
from choreograph.importers.folder import SongsByName
from choreograph.motifs.signatures import signature
from choreograph.motion.retargeting import retarget
from choreograph.numerics import default_numerics
from choreograph.pipeline.arguments import as_repertoire
from choreograph.repertoire import Repertoire
from choreograph.takes import Take


@default_numerics()
def motifs_of(take: str | Path, repertoire: Repertoire) -> tuple[int, ...]:
    """The motifs of a dance in their order, to be danced again to another song.

    `take` is the name of a take of the repertoire, or a motion file (or a folder of one take). A file is
    segmented on the beats of the song beside it, or on its motion beats if there is none.

    Raises `ParameterError` if it is neither, or has no motion word; `FormatError` if the file is damaged;
    `RepertoireError` without a vocabulary.
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
    """The signature (K,) of a genre, or of a take as `motifs_of` finds it; raises as it does."""
    repertoire = as_repertoire(repertoire)
    vocabulary = repertoire.vocabulary
    as_path("a take, or the name of one or of a genre", name)
    if name in vocabulary.genres:
        return vocabulary.signatures[vocabulary.genre_index(name)]
    return signature(np.array(motifs_of(name, repertoire)), vocabulary.n_motifs)


def _only_take(path: Path) -> Take:
    takes = list(import_takes(path))
    if len(takes) != 1:
        raise ParameterError(f"{path}: expected one take to dance again, got {len(takes)}")
    take = takes[0]
    song = take.song_path or SongsByName.in_folder(path.parent).of(path.stem)
    return replace(take, song_path=song)


def _on_skeleton(take: Take, repertoire: Repertoire) -> Take:
    if take.motion.skeleton.same_as(repertoire.skeleton):
        return take
    return replace(take, motion=retarget(take.motion, repertoire.skeleton))
