"""The networks of a repertoire: their training data, and whether they are kept or trained.

Networks of style and tempo-density are trained on pairs of music and motion, the network of words on motion
words, and the rollout network on takes with their words and their music. The rollout network may also learn
from dances that an engine makes from the takes to their songs. These are on the count by construction, so
that the network keeps counts and bars better. The engine is passed as a `Teacher`, since this package does
not import engines. Training imports torch.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import sha256_of
from choreograph.core.progress import ProgressReport, substage
from choreograph.core.timebase import CLIP_S, MUSIC_FPS, NET_FPS, WORD_FPS, seconds_to_frames
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import measure_take, path_within
from choreograph.library.building.words import FEWEST_WORDS, KeptMotifs, SegmentedTake, segment_takes
from choreograph.library.builtin import NOTHING, PretrainedNet, shipped_checksums
from choreograph.library.catalogue import files_of
from choreograph.library.notes import Note
from choreograph.library.repertoire import Repertoire, starter_repertoire
from choreograph.library.schema import NetArrays
from choreograph.library.songs import SongCache, music_of_take
from choreograph.library.vocabulary import Vocabulary
from choreograph.library.writing import Contents, MeasuredTake, write_repertoire
from choreograph.motion.motion import Take
from choreograph.music.rhythm import rhythm_features

if TYPE_CHECKING:
    from choreograph.nets.configs import RolloutConfig
    from choreograph.nets.rollout_training import RolloutTake
    from choreograph.nets.stored import StoredNet
    from choreograph.nets.style_training import StyleTake
    from choreograph.nets.training import TrainingContext
    from choreograph.nets.words import WordNet

# The content of a training: checksums of takes, and the options that matter. A checkpoint of other content is
# not continued (`nets.training`).


_DIGITS = 16  # of a checksum, enough to distinguish files


def source_checksums(
    measured: Sequence[MeasuredTake], sources: Iterable[str | Path]
) -> list[tuple[str, str, int]]:
    """Path in its source, SHA-256 and number of the take, of every file that a take was read from.

    The paths do not depend on the machine or on how the sources were typed. Files outside of all sources,
    such as songs in a manifest, are listed by their names only.
    """
    folders = [Path(source) for source in sources]
    known: dict[Path, tuple[str, str]] = {}
    rows = []
    for index, m in enumerate(measured):
        for path in m.take.source_paths:
            if path not in known:
                known[path] = path_within(path, folders), sha256_of(path)
            rows.append((*known[path], index))
    return rows


def training_content(
    measured: Sequence[MeasuredTake], checksums: Sequence[tuple[str, str, int]], options: BuildOptions
) -> dict[str, str]:
    """The content of a training: checksums of takes and initial networks by name, and settings.

    Settings in the configuration of a network (sizes, steps, seed) are not repeated.
    """
    init_from = [] if options.init_from is None else [options.init_from]
    content = {
        "choreograph": version("choreograph"),
        "beats": options.beats,
        "lock_feet": str(options.lock_feet),
        "precision": options.precision,
        "pretrained": _digest([options.pretrained, *shipped_checksums(options.pretrained)]),
        "train_words": str(options.train_words),
        "keep_networks": str(options.keep_networks),
        "init_from": _digest([sha256_of(path) for path in files_of(init_from)]) if init_from else "",
    }
    for index, m in enumerate(measured):
        take = m.take
        files = [checksum for _, checksum, of_take in checksums if of_take == index]
        description = [asdict(take.credits), take.song_name, take.song_start_s, take.counts.source]
        content[f"take {take.name}"] = _digest([*files, *description])
    return content


def checksum_of(examples: Iterable[Any]) -> str:
    """A checksum of dataclasses of arrays, texts and numbers, such as the takes of a training."""
    digest = hashlib.sha256()
    for example in examples:
        for entry in fields(example):
            value = getattr(example, entry.name)
            digest.update(f"{entry.name} {type(value).__name__} ".encode())
            if isinstance(value, np.ndarray):
                digest.update(f"{value.dtype} {value.shape} ".encode() + value.tobytes())
            elif is_dataclass(value):
                digest.update(checksum_of([value]).encode())
            else:
                digest.update(repr(value).encode())
    return digest.hexdigest()[:_DIGITS]


def _digest(values: Sequence[Any]) -> str:
    return hashlib.sha256(json.dumps(values).encode()).hexdigest()[:_DIGITS]


# The networks of a repertoire, each kept from another repertoire or trained.


STYLE_NET = "style"  # trained on pairs of music and motion
WORDS_NET = "words"  # trained on motion words
DENSITY_NETS = ("motion_density", "music_density")  # likewise, if clips have the learned tempo-density


@dataclass(frozen=True)
class PretrainedWeights:
    """Networks that training starts from, or that are kept, of another repertoire or the shipped ones.

    Motifs are kept with the networks of another repertoire.
    """

    nets: Mapping[str, NetArrays] = field(default_factory=dict)
    trained_on: frozenset[str] = frozenset()  # songs that any of them was trained on
    keep: bool = False
    from_shipped: bool = False  # style is the shipped set's
    motifs: KeptMotifs | None = None  # that are kept with the networks

    @classmethod
    def of(cls, options: BuildOptions, shipped: Mapping[str, PretrainedNet]) -> PretrainedWeights:
        """The networks chosen by the options. The shipped ones have the preset "small".

        The shipped network of motion words is that of the built-in repertoire.

        Raises `RepertoireError` if a repertoire cannot be read, `ParameterError` if there is nothing to keep.
        """
        nets: dict[str, NetArrays] = {}
        trained_on = frozenset[str]()
        motifs: KeptMotifs | None = None
        if options.init_from is not None:
            other = Repertoire.open(options.init_from)
            nets = {name: other.net(name) for name in other.net_names}
            if options.keep_networks and other.has_vocabulary:
                motifs = KeptMotifs.of(other, compress=options.compress)
            trained_on |= set(other.provenance.get("trained_on", ()))
        with_shipped = options.preset == "small" and options.pretrained != NOTHING
        begins = with_shipped and STYLE_NET in shipped and STYLE_NET not in nets
        if begins:
            nets[STYLE_NET] = shipped[STYLE_NET].arrays
            trained_on |= set(shipped[STYLE_NET].trained_on)
        if with_shipped and options.words and WORDS_NET not in nets and not options.train_words:
            nets[WORDS_NET] = starter_repertoire().net(WORDS_NET)
        if options.keep_networks and options.init_from is None and not begins:
            raise ParameterError(
                "expected networks to keep, of another repertoire (--init-from) or of a shipped set "
                "(--pretrained, with preset small), got none"
            )
        if options.keep_networks and options.compress:  # as the file will hold them
            for name, net in nets.items():
                rounded = {of: a.astype(np.float16).astype(np.float32) for of, a in net.weights.items()}
                nets[name] = replace(net, weights=rounded)
        return cls(nets, trained_on, options.keep_networks, begins, motifs)

    @property
    def kept(self) -> Mapping[str, NetArrays]:
        """Networks that are kept without training."""
        return self.nets if self.keep else {}

    def weights(self, name: str) -> Mapping[str, Any] | None:
        """Weights that training starts from, or None for random ones."""
        net = self.nets.get(name)
        return None if net is None else net.weights


def train_music_networks(
    measured: Sequence[MeasuredTake],
    songs: SongCache,
    pretrained: PretrainedWeights,
    *,
    options: BuildOptions,
    context: TrainingContext,
    report: ProgressReport | None,
) -> tuple[dict[str, NetArrays], list[str], list[Note]]:
    """Style networks, those of tempo-density if it is learned, the songs they were trained on, and notes.

    Networks that are not kept are trained if the takes have two songs or more. With fewer songs, the
    pretrained networks are used unchanged. The networks of tempo-density are used only if it is learned.
    """
    wanted = (STYLE_NET, *(DENSITY_NETS if options.density == "learned" else ()))
    with_music = [m for m in measured if m.take.song_path is not None]
    song_names = {m.take.song_name for m in with_music}
    known = {name: net for name, net in pretrained.nets.items() if name in wanted}
    if pretrained.keep and set(known) == set(wanted):
        return known, sorted(pretrained.trained_on), []
    if len(song_names) >= 2:
        paths = [m.take.song_path for m in with_music if m.take.song_path is not None]
        songs.analyse(paths, substage(report, "analysing songs"))
        takes = [style_take(m, songs) for m in with_music]
        kept = known if pretrained.keep else {}
        nets = _trained(takes, kept, pretrained, options=options, context=context)
        return nets, sorted(song_names | pretrained.trained_on), []
    if known:
        notes = [] if pretrained.keep else [Note("networks unchanged")]
        return known, sorted(pretrained.trained_on), notes
    return {}, [], [Note("no music networks")]


def _trained(
    takes: Sequence[StyleTake],
    kept: Mapping[str, NetArrays],
    pretrained: PretrainedWeights,
    *,
    options: BuildOptions,
    context: TrainingContext,
) -> dict[str, NetArrays]:
    """The networks of style, and of tempo-density if it is learned. Those in `kept` are not trained.

    Of tempo-density, that of music needs that of motion. Without a take of 8 s of music and motion, there are
    none that are not kept.
    """
    from choreograph.nets.configs import density_config, style_config
    from choreograph.nets.density import MotionDensity
    from choreograph.nets.density_training import train_motion_density, train_music_density
    from choreograph.nets.style_training import train_style

    nets = dict(kept)
    given: dict[str, Any] = {"seed": options.seed, "context": context}
    if STYLE_NET not in nets:
        n_songs = len({take.song_name for take in takes})
        changes = _changes(options) | dict(options.style_changes)
        config = style_config(options.preset, n_songs=n_songs, **changes)
        style = train_style(takes, config, pretrained=pretrained.weights(STYLE_NET), **given)
        nets[STYLE_NET] = _stored(style)
    longest_s = max(min(len(t.body_pos_m) / NET_FPS, len(t.log_mel) / MUSIC_FPS) for t in takes)
    if options.density != "learned" or longest_s < CLIP_S:
        return nets
    densities = density_config(options.preset, **(_changes(options) | dict(options.density_changes)))
    if "motion_density" in nets:
        motion = MotionDensity.from_arrays(nets["motion_density"].weights, nets["motion_density"].config)
    else:
        weights = pretrained.weights("motion_density")
        motion = train_motion_density(takes, densities, pretrained=weights, **given)
        nets["motion_density"] = _stored(motion)
    if "music_density" not in nets:
        weights = pretrained.weights("music_density")
        music = train_music_density(takes, motion, densities, pretrained=weights, **given)
        nets["music_density"] = _stored(music)
    return nets


def train_word_network(
    takes: Sequence[SegmentedTake],
    pretrained: PretrainedWeights,
    *,
    options: BuildOptions,
    context: TrainingContext,
) -> NetArrays | None:
    """The network that embeds motion words, or None if there are too few words and none is kept."""
    from choreograph.nets.configs import word_config
    from choreograph.nets.words import WordTake, train_word_net

    n_words = sum(len(take.words) for take in takes)
    if WORDS_NET in pretrained.kept or n_words < FEWEST_WORDS:
        return pretrained.kept.get(WORDS_NET)
    weights = pretrained.weights(WORDS_NET)
    net = train_word_net(
        [WordTake(t.name, t.body_pos_m, WORD_FPS, t.words.start_s, t.words.end_s) for t in takes],
        word_config(options.preset, n_words=n_words, pretrained=weights is not None, **_changes(options)),
        seed=options.seed, context=context, pretrained=weights,
    )  # fmt: skip
    return _stored(net)


def _changes(options: BuildOptions) -> dict[str, Any]:
    """Changes to the preset of every network."""
    return {} if options.augment_mirror else {"mirrored_share": 0.0}


def _stored(net: StoredNet) -> NetArrays:
    weights, config = net.to_arrays()
    return NetArrays(config, weights)


def style_take(measured: MeasuredTake, songs: SongCache) -> StyleTake:
    """A take for the training of style, with its part of the song. Raises `FormatError` if there is none."""
    from choreograph.nets.style_training import StyleTake

    take = measured.take
    assert take.song_path is not None  # only takes with music are passed
    song = songs.analysed(take.song_path)
    mel = song.log_mel
    rhythm = rhythm_features(mel, song.counts, start_s=max(0.0, take.song_start_s))
    first = seconds_to_frames(take.song_start_s, MUSIC_FPS)
    last = first + seconds_to_frames(take.motion.duration_s, MUSIC_FPS)
    if first >= len(mel):
        raise FormatError(
            f"{take.song_path}: expected music at {take.song_start_s:g} s, where {take.name} begins, got a "
            f"song of {song.duration_s:.1f} s"
        )
    silent = np.full((max(0, -first), mel.shape[1]), mel.min(), mel.dtype)
    return StyleTake(
        name=take.name,
        genre=take.credits.genre,
        log_mel=np.concatenate([silent, mel[max(0, first) : max(0, last)]]),
        rhythm=rhythm,
        song_name=take.song_name,
        body_pos_m=measured.body_pos_m,
        motion_beat_times_s=measured.motion_beats_s,
    )


# The rollout network.


# Dances of a repertoire to the songs of takes, as takes with counts. The folder keeps finished work for a
# resumed build.
Teacher = Callable[[Repertoire, Sequence[Take], Path], list[Take]]


def train_rollout_network(
    measured: Sequence[MeasuredTake],
    segmented: Sequence[SegmentedTake],
    vocabulary: Vocabulary,
    words: WordNet,
    config: RolloutConfig,
    *,
    dances: Sequence[Take] = (),
    songs: SongCache,
    seed: int,
    context: TrainingContext,
    pretrained: NetArrays | None,
    report: ProgressReport | None,
) -> dict[str, NetArrays]:
    """Train the rollout network on all takes with music and on `dances` of them. Returns it by its name.

    With `RolloutConfig.by_genre` there is one for each genre, as in the paper (section 5). Training starts
    from `pretrained` if given. Raises `ParameterError` if no take, or no take of a genre, has words with
    music for as long as a training sequence.
    """
    from choreograph.nets.rollout_training import train_rollouts

    takes = rollout_takes(measured, segmented, vocabulary, words, songs=songs, report=report)
    if dances:
        danced = [measure_take(take) for take in dances]
        danced_words, of_dances = words_of_dances(danced, vocabulary, words, songs)
        takes += rollout_takes(danced, danced_words, of_dances, words, songs=songs, report=report)
    weights = None if pretrained is None else pretrained.weights
    nets = {}
    trained = train_rollouts(takes, words, config, seed=seed, context=context, pretrained=weights)
    for index, net in enumerate(trained):
        arrays, stored = net.to_arrays()
        nets[f"rollout_{index}" if config.by_genre else "rollout"] = NetArrays(stored, arrays)
    return nets


def taught_dances(contents: Contents, takes: Sequence[Take], teacher: Teacher, work: Path) -> list[Take]:
    """The teacher's dances to the songs of `takes` with the repertoire of `contents`.

    That repertoire and the finished dances are stored in `work`, where a resumed build with the same contents
    finds them.
    """
    draft = work / "untaught.h5"
    work.mkdir(parents=True, exist_ok=True)
    write_repertoire(draft, contents)
    return teacher(Repertoire.open(draft), takes, work / f"graph-dances-{sha256_of(draft)[:12]}")


def rollout_takes(
    measured: Sequence[MeasuredTake],
    segmented: Sequence[SegmentedTake],
    vocabulary: Vocabulary,
    words: WordNet,
    *,
    songs: SongCache,
    report: ProgressReport | None = None,
) -> list[RolloutTake]:
    """The takes with music, as training data of the network.

    The rhythm of the music is aligned with the counts of the take, even if the recording is not. `segmented`
    are the words of `measured`. `songs` must keep samples.
    """
    from choreograph.nets.rollout_poses import ROLLOUT_FPS
    from choreograph.nets.rollout_training import RolloutTake

    takes = []
    for index, (m, of_take) in enumerate(zip(measured, segmented, strict=True)):
        take, bounds = m.take, of_take.words
        if take.song_path is None or len(bounds) == 0:
            continue
        analysed = songs.analysed(take.song_path)
        music = music_of_take(take, analysed, np.append(bounds.start_s, bounds.end_s[-1]))
        motif = vocabulary.word_motif[vocabulary.words_of_take(index)]
        takes.append(
            RolloutTake(
                name=take.name,
                motion=take.motion.resampled(ROLLOUT_FPS),
                rhythm=music.rhythm,
                count_phase=music.count_phase,
                start_s=bounds.start_s,
                end_s=bounds.end_s,
                motif=vocabulary.motifs.embeddings[motif],
                embedding=words.embed(bounds.body_pos_m),
                spectral=music.spectral,
                genre=take.credits.genre,
            )
        )
        if report is not None:
            report("analysing the music of words", index + 1, len(measured))
    return takes


def words_of_dances(
    dances: Sequence[MeasuredTake], vocabulary: Vocabulary, words: WordNet, songs: SongCache
) -> tuple[list[SegmentedTake], Vocabulary]:
    """The words of dances, and the vocabulary with these words instead of those of the takes."""
    segmented, _ = segment_takes(dances, songs)
    motif = vocabulary.motifs.nearest(words.embed(np.concatenate([t.words.body_pos_m for t in segmented])))
    of_dances = replace(
        vocabulary,
        word_take=np.repeat(np.arange(len(segmented)), [len(take.words) for take in segmented]),
        word_start_s=np.concatenate([take.words.start_s for take in segmented]),
        word_end_s=np.concatenate([take.words.end_s for take in segmented]),
        word_motif=motif,
    )
    return segmented, of_dances
