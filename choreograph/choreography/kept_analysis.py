"""Analyses of songs, kept in the user's cache, so that another dance to a song does not analyse it again.

The motifs of spans of takes are kept in another folder, since most spans of two dances are the same. In a
third one are checksums of the samples of files, so that a file of which all is known is not decoded again.

An entry of `core.kept` depends on the content of the file or the samples, the repertoire, the options, and
the program itself. It holds arrays and JSON, and nothing that is executed.
"""

from __future__ import annotations

import io
import json
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts
from choreograph.core.files import as_path, cache_folder, sha256_of
from choreograph.core.kept import KeptEntries, libraries, program
from choreograph.core.numerics import Floats, digest
from choreograph.library.motifs import SpanMotifLookup
from choreograph.library.repertoire import Repertoire
from choreograph.library.songs import names_a_tracker
from choreograph.music.form import Form, Phrase, Sections
from choreograph.music.samples import Samples, sha256_of_samples
from choreograph.music.song import KnownSong, Song, check_song_file, load_sound
from choreograph.music.song_features import SongFeatures

Analysis = tuple[SongFeatures, tuple[str, ...]]  # with notes
Array = NDArray[np.float32]

MAX_BYTES = 64 << 20  # of all entries: about 600 songs of three minutes
_MAX_SONG_BYTES = 4 << 20  # of the checksums of samples
_ARRAYS = ("style", "beat_count", "density", "energy", "onset_density")
_NUMBERS = ("duration_s", "opening_s", "closing_s", "off_beat")
_log = logging.getLogger("choreograph")


def kept_song(path: str | Path, *, start_s: float, duration_s: float | None, keep: bool = True) -> Song:
    """As `as_song` of a file, whose samples can be forgotten.

    With `keep`, it is decoded when its samples are used, if the same content was decoded before.
    """

    path = as_path("a song", path)

    def decoded() -> tuple[Samples, tuple[str, ...]]:
        return load_sound(path, start_s=start_s, duration_s=duration_s)

    check_song_file(path)
    folder, _ = cache_folder("songs") if keep else (None, "")
    entries = None if folder is None else KeptEntries(folder, _MAX_SONG_BYTES, ".json")
    key = digest(program(), libraries(), path.stem, sha256_of(path), start_s, duration_s) if entries else b""
    content, sound = entries.read(key) if entries else None, None
    if content is None:
        sound, notes = decoded()
        content = json.dumps([notes, len(sound), sha256_of_samples(sound).hex()]).encode()
        if entries:
            entries.write(key, content)
    notes, n_samples, sha256 = json.loads(content)
    return KnownSong(
        lambda: decoded()[0], path, tuple(notes), start_s, n_samples, bytes.fromhex(sha256), sound
    )


def kept_analysis(
    song: Song, repertoire: Repertoire, beats: str | Path, genre: str | None, analyse: Callable[[], Analysis]
) -> Analysis:
    """The analysis of a song from the cache. If there is none, it is made by `analyse` and written there."""
    key = digest(
        *(program(), repertoire.analysis_digest),
        *(song.name, song.notes, song.start_s, tracker_digest(beats), genre, song.samples_sha256),
    )
    return from_bytes(_kept(key, lambda: to_bytes(analyse())))  # also what was just made, as it is read later


def kept_rows(song: Song, name: str, times_s: Floats, make: Callable[[], Array]) -> Array:
    """Rows of features of a song at `times_s` (N,), as `kept_analysis`. `name` is that of the features."""

    def written() -> bytes:
        content = io.BytesIO()
        np.save(content, make())
        return content.getvalue()

    key = digest(program(), name, times_s, song.samples_sha256)
    rows: Array = np.load(io.BytesIO(_kept(key, written)), allow_pickle=False)
    return rows


_MOST_SPANS = 1 << 19  # of takes whose motifs are kept: 5 MB
_FEWEST_NEW = 512  # spans, whose motifs take longer to compute than to write


@contextmanager
def kept_spans(repertoire: Repertoire, *, keep: bool) -> Iterator[SpanMotifLookup]:
    """The motifs of spans of takes, with those that earlier dances looked up. New ones are kept, too.

    The key is that of the files' state, of their motifs, and of the network. Without `keep`, nothing is read
    and nothing is written.
    """
    spans = repertoire.span_motifs
    folder, _ = cache_folder("motifs") if keep else (None, "")
    if folder is None:
        yield spans
        return
    net, motifs = repertoire.word_net(), repertoire.vocabulary.motifs
    files = [(str(path.resolve()), _state(path)) for path in repertoire.paths]
    key = digest(program(), "spans", files, motifs.embeddings, net.config, net.weights)
    entries = KeptEntries(folder, MAX_BYTES, ".npz")
    content = entries.read(key)
    if content is not None:
        with np.load(io.BytesIO(content), allow_pickle=False) as stored:
            spans.add(stored["keys"], stored["motifs"])
    n_known = len(spans.known[0])
    yield spans
    if n_known + _FEWEST_NEW <= len(spans.known[0]) <= _MOST_SPANS:
        written = io.BytesIO()
        keys, labels = spans.known
        np.savez(written, keys=keys, motifs=labels)
        entries.write(key, written.getvalue())


def _state(path: Path) -> tuple[int, int]:
    """The time of the last change of a file, and its size, or zeros if it is gone."""
    try:
        status = path.stat()
    except OSError:
        return 0, 0
    return status.st_mtime_ns, status.st_size


def _kept(key: bytes, make: Callable[[], bytes]) -> bytes:
    """The content of the entry with this key, which is made and written if there is none."""
    folder, why_not = cache_folder("analyses")
    if folder is None:
        _log.warning("the analysis of the song is not kept: %s", why_not)
        return make()
    entries = KeptEntries(folder, MAX_BYTES, ".npz")
    kept = entries.read(key)
    if kept is not None:
        return kept
    content = make()
    entries.write(key, content)
    return content


def tracker_digest(beats: str | Path) -> str:
    """The name of a tracker, or a digest of the content of a file with beats."""
    return str(beats) if names_a_tracker(beats) else sha256_of(beats)


def to_bytes(analysis: Analysis) -> bytes:
    """An analysis as the content of an .npz file."""
    features, notes = analysis
    counts, sections = features.counts, features.sections
    about: dict[str, Any] = {
        "name": features.name,
        **{name: float(getattr(features, name)) for name in _NUMBERS},
        "counts": [counts.metre, counts.source, counts.confidence],
        "stops_s": features.stops_s,
        "phrases": [asdict(phrase) for phrase in features.form.phrases],
        "notes": notes,
    }
    content = io.BytesIO()
    np.savez(
        content,
        about=np.array(json.dumps(about)),
        times_s=counts.times_s,
        numbers=counts.numbers,
        uncertainty=counts.uncertainty,
        bounds_s=sections.bounds_s,
        labels=sections.labels,
        **{name: getattr(features, name) for name in _ARRAYS},
    )
    return content.getvalue()


def from_bytes(content: bytes) -> Analysis:
    """The analysis of `to_bytes`."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    about = json.loads(str(arrays["about"]))
    metre, source, confidence = about["counts"]
    features = SongFeatures(
        name=about["name"],
        counts=Counts(arrays["times_s"], arrays["numbers"], metre, source, confidence, arrays["uncertainty"]),
        sections=Sections(arrays["bounds_s"], arrays["labels"]),
        stops_s=tuple((rests_s, moves_s) for rests_s, moves_s in about["stops_s"]),
        form=Form(tuple(Phrase(**phrase) for phrase in about["phrases"])),
        **{name: arrays[name] for name in _ARRAYS},
        **{name: about[name] for name in _NUMBERS},
    )
    return features, tuple(about["notes"])
