"""Training of the style networks: takes and songs, augmentation, batches, equation 1, a contrastive loss."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyInts
from choreograph.core.timebase import MUSIC_FPS, NET_FPS, SEGMENT_FRAMES, SEGMENT_S
from choreograph.motion.body import mirrored
from choreograph.music.mel import MEL_BANDS, N_BANDS
from choreograph.music.rhythm import LOUDNESS, METRE, ONSETS, PATTERN, RHYTHM_FPS, TEMPO
from choreograph.nets.configs import StyleConfig
from choreograph.nets.inference import MEL_FRAMES
from choreograph.nets.processes import gathered, own_rows
from choreograph.nets.style import StyleNets, centred, rotated_about_y
from choreograph.nets.training import TrainingContext, forked_rng, load_pretrained, steps_of_epochs, train

# Augmentation of samples: other recordings of a song, and other bodies.


_NEPER_PER_DB = np.log(10.0) / 10.0  # natural logarithm of power in one decibel
_P_HIDDEN = 0.15  # probability that tempo and metre, or the patterns, are set to zero


class MelChange(NamedTuple):
    """What makes another recording of a segment.

    It gets a gain of ±10 dB, a smooth filter of ±8 dB, a pitch shift of up to 6 bands and a noise floor. Half
    of the segments are mixed with another one of the batch at -6 to -20 dB. One span of time or bands is
    masked.
    """

    mixed: tuple[int, float] | None  # with another segment of the batch, which is quieter by this
    n_bands: int  # that it is shifted up
    curve: NDArray[np.float64]  # (6,) of a filter
    gain: float
    noise: float  # below the maximum
    masked: tuple[int, int, int]  # axis, start and length

    @classmethod
    def drawn(cls, size: int, rng: np.random.Generator) -> list[MelChange]:
        """One for each segment of a batch (B, 240, 96)."""
        changes = []
        for _ in range(size):
            mixed = None
            if rng.random() < 0.5:
                level = _NEPER_PER_DB * rng.uniform(6, 20)
                mixed = int(rng.integers(size)), level
            n_bands = int(rng.integers(-6, 7))
            curve = _NEPER_PER_DB * rng.uniform(-8, 8, 6)
            gain, noise = _NEPER_PER_DB * rng.uniform(-10, 10), _NEPER_PER_DB * rng.uniform(30, 90)
            if rng.random() < 0.5:
                masked = 1, int(rng.integers(MEL_BANDS)), int(rng.integers(1, 17))
            else:
                masked = 0, int(rng.integers(MEL_FRAMES)), int(rng.integers(1, 41))
            changes.append(cls(mixed, n_bands, curve, gain, noise, masked))
        return changes

    def changed(
        self, segment: NDArray[np.float32], batch: NDArray[np.float32], floor: float
    ) -> NDArray[np.floating]:
        """The changed segment (240, 96) of a batch (B, 240, 96) whose minimum is `floor`."""
        bands = np.arange(segment.shape[1])
        mixed: NDArray[np.floating] = segment
        if self.mixed is not None:
            other, level = self.mixed
            mixed = np.logaddexp(segment, batch[other] - level)
        source = np.clip(bands - self.n_bands, 0, len(bands) - 1)
        curve = np.interp(bands, np.linspace(0, len(bands) - 1, len(self.curve)), self.curve)
        changed: NDArray[np.floating] = mixed[:, source] + curve + self.gain
        noise = changed.max() - self.noise
        changed = np.maximum(changed, noise)
        axis, start, length = self.masked
        part = slice(start, start + length)
        changed[(slice(None), part) if axis else part] = max(floor, noise)
        return changed


def augment_mel(log_mel: NDArray[np.float32], changes: Sequence[MelChange]) -> NDArray[np.float32]:
    """Segments (B, 240, 96) in another key, room and mix, by their changes. Onset times do not change."""
    out = np.empty_like(log_mel)
    floor = log_mel.min()
    for row, change in enumerate(changes):
        out[row] = change.changed(log_mel[row], log_mel, floor)
    return out


def augment_rhythm(rhythm: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Rhythm (B, RHYTHM_DIM) up to 7 % faster or slower, with other instruments, sometimes partly zero.

    Tempo and metre, or the patterns, are sometimes set to zero, as in music without beats.
    """
    out = np.array(rhythm, np.float32)
    size = len(out)
    out[:, TEMPO] = _shifted(out[:, TEMPO], rng.uniform(-1.2, 1.2, size))
    bands = out[:, PATTERN].reshape(size, N_BANDS, -1)
    blend = np.eye(N_BANDS) + rng.uniform(0.0, 0.4, (size, N_BANDS, N_BANDS))
    bands = np.einsum("bij,bjd->bid", blend / blend.sum(axis=2, keepdims=True), bands)
    bands = bands * np.exp(rng.normal(0.0, 0.15, bands.shape))
    out[:, PATTERN] = bands.reshape(size, -1)
    out[:, LOUDNESS] += rng.normal(0.0, 0.5, size)
    out[:, ONSETS] *= np.exp(rng.normal(0.0, 0.05, size))
    hidden = rng.random(size)
    out[hidden < _P_HIDDEN, TEMPO.start : METRE.stop] = 0.0
    out[hidden > 1.0 - _P_HIDDEN, PATTERN] = 0.0
    return out


def _shifted(rows: NDArray[np.float32], by: NDArray[np.floating]) -> NDArray[np.floating]:
    """Rows (B, N) moved by fractional columns (B,). The ends are repeated."""
    position = np.clip(np.arange(rows.shape[1]) + by[:, None], 0, rows.shape[1] - 1.001)
    low = position.astype(np.int64)
    weight = position - low
    return np.take_along_axis(rows, low, 1) * (1 - weight) + np.take_along_axis(rows, low + 1, 1) * weight


def augment_body(
    body_pos_m: NDArray[np.float32], rng: np.random.Generator, *, mirrored_share: float
) -> NDArray[np.float32]:
    """Segments (B, 80, 21, 3) centred, some mirrored, rotated by up to 30° and scaled by up to 10 %."""
    flip = rng.random(len(body_pos_m)) < mirrored_share
    body = np.where(flip[:, None, None, None], mirrored(body_pos_m), body_pos_m)
    body = rotated_about_y(centred(body), rng.uniform(-np.pi / 6, np.pi / 6, len(body)))
    return (body * rng.uniform(0.9, 1.1, (len(body), 1, 1, 1))).astype(np.float32)


# Training data of the style networks: takes and songs as arrays, and balanced batches of them.


@dataclass(frozen=True, eq=False)
class StyleSong:
    """A song as training data."""

    name: str
    genre: str  # "" if unknown
    log_mel: NDArray[np.float32]  # (T60, 96) at 60 fps
    rhythm: NDArray[np.float32]  # (M, RHYTHM_DIM) at 2 fps, from the same time on

    @property
    def n_starts(self) -> int:
        """Number of 4 s segments, one starting every half second."""
        return _n_starts(len(self.log_mel) / MUSIC_FPS)

    def mel_at(self, start: int) -> NDArray[np.float32]:
        """Log-mel (240, 96) of the segment that starts after `start` half seconds."""
        frame = start * (MUSIC_FPS // RHYTHM_FPS)
        return self.log_mel[frame : frame + MEL_FRAMES]

    def rhythm_at(self, starts: AnyInts | int) -> NDArray[np.float32]:
        """Rhythm (..., RHYTHM_DIM) in the middle of segments."""
        return self.rhythm[np.minimum(np.add(starts, SEGMENT_S // 2 * RHYTHM_FPS), len(self.rhythm) - 1)]


@dataclass(frozen=True, eq=False)
class StyleTake(StyleSong):
    """One take as training data. All arrays begin at the motion's first frame."""

    song_name: str  # takes of one song are never each other's negatives
    body_pos_m: NDArray[np.float32]  # (T20, 21, 3) at 20 fps
    motion_beat_times_s: NDArray[np.float64]  # (Q,)

    @property
    def n_starts(self) -> int:
        """Number of 4 s segments, one starting every half second, that lie inside music and motion."""
        return _n_starts(min(len(self.log_mel) / MUSIC_FPS, len(self.body_pos_m) / NET_FPS))

    def body_at(self, start: int) -> NDArray[np.float32]:
        """Body positions (80, 21, 3) of the segment that starts after `start` half seconds."""
        frame = start * (NET_FPS // RHYTHM_FPS)
        return self.body_pos_m[frame : frame + SEGMENT_FRAMES]

    def beat_counts(self, starts: AnyInts) -> NDArray[np.float32]:
        """Motion beats (N,) in the segments from each of `starts` (N,)."""
        return count_beats(self.motion_beat_times_s, starts / RHYTHM_FPS)


@dataclass(frozen=True, eq=False)
class StyleBatch:
    """B segments of music with the motion danced to them, then S segments of songs without motion."""

    mel: Tensor  # (B + S, 240, 96), or (B + S, 0, 96) where the networks have no use for it
    rhythm: Tensor  # (B + S, RHYTHM_DIM)
    body: Tensor  # (B, 80, 21, 3)
    n_beats: Tensor  # (B,)
    song: Tensor  # (B,) integer label
    genre: Tensor  # (B + S,) integer label, -1 if unknown

    def to(self, device: torch.device) -> StyleBatch:
        """The batch on a device."""
        return StyleBatch(*(getattr(self, field.name).to(device) for field in fields(self)))


class StyleData:
    """The takes of a training run, and its songs without takes.

    Raises `ParameterError` if fewer than two songs have 4 s of pairs.
    """

    def __init__(
        self, takes: Sequence[StyleTake], songs: Sequence[StyleSong] = (), *, balanced_genres: bool = True
    ) -> None:
        self.takes = [take for take in takes if take.n_starts > 0]
        self.songs = [song for song in songs if song.n_starts > 0]
        names = sorted({take.song_name for take in self.takes})
        if len(names) < 2:
            raise ParameterError(
                f"expected takes of two songs or more with {SEGMENT_S} s of music and motion to learn style "
                f"from, got {len(names)}"
            )
        examples = [*self.takes, *self.songs]
        genres = sorted({song.genre for song in examples} - {""})
        self._song = np.array([names.index(take.song_name) for take in self.takes])
        self._genre = np.array([genres.index(song.genre) if song.genre else -1 for song in examples])
        self._of_take = _probability(self.takes, balanced_genres)
        self._of_song = _probability(self.songs, balanced_genres)

    @property
    def n_segments(self) -> float:
        """Length of the takes in segments of 4 s that do not overlap."""
        return sum((take.n_starts - 1) / (RHYTHM_FPS * SEGMENT_S) + 1 for take in self.takes)

    def statistics(self) -> dict[str, NDArray[np.float32]]:
        """Means and deviations for standardising inputs, by the names of the buffers of `StyleNets`."""
        examples = [*self.takes, *self.songs]
        mel = np.concatenate([song.log_mel for song in examples])
        rhythm = np.concatenate([song.rhythm for song in examples])
        counts = np.concatenate([take.beat_counts(np.arange(take.n_starts)) for take in self.takes])
        return {
            "mel_mean": mel.mean(axis=0),
            "mel_std": mel.std(axis=0) + 0.1,
            "rhythm_mean": rhythm.mean(axis=0),
            "rhythm_std": rhythm.std(axis=0) + 0.05,
            "beats_mean": np.array([counts.mean()], np.float32),
            "beats_std": np.array([counts.std() + 0.1], np.float32),
        }

    def batch(
        self,
        size: int,
        rng: np.random.Generator,
        *,
        mirrored_share: float = 0.5,
        augmented: bool = True,
        with_mel: bool = True,
    ) -> StyleBatch:
        """Random segments of `size` pairs, and as many of songs if there are any, augmented or not.

        The same segments and changes are drawn without mel.
        """
        pairs = rng.choice(len(self.takes), size, p=self._of_take)
        alone = rng.choice(len(self.songs), size, p=self._of_song) if self.songs else np.zeros(0, np.int64)
        examples = [self.takes[i] for i in pairs] + [self.songs[i] for i in alone]
        index = np.concatenate([pairs, len(self.takes) + alone])
        starts = [int(rng.integers(song.n_starts)) for song in examples]
        takes = [self.takes[i] for i in pairs]
        mel = np.zeros((len(examples), 0, MEL_BANDS), np.float32)
        if with_mel:
            mel = np.stack([song.mel_at(start) for song, start in zip(examples, starts, strict=True)])
        rhythm = np.stack([song.rhythm_at(start) for song, start in zip(examples, starts, strict=True)])
        body = np.stack([take.body_at(start) for take, start in zip(takes, starts, strict=False)])
        n_beats = [take.beat_counts(np.array([start]))[0] for take, start in zip(takes, starts, strict=False)]
        if augmented:
            changes = MelChange.drawn(len(examples), rng)
            mel = augment_mel(mel, changes) if with_mel else mel
            rhythm = augment_rhythm(rhythm, rng)
            body = augment_body(body, rng, mirrored_share=mirrored_share)
        else:
            body = centred(body)
        return StyleBatch(
            torch.from_numpy(mel),
            torch.from_numpy(rhythm),
            torch.from_numpy(body),
            torch.tensor(np.array(n_beats, np.float32)),
            torch.from_numpy(self._song[pairs]),
            torch.from_numpy(self._genre[index]),
        )


def count_beats(beat_times_s: NDArray[np.floating], starts_s: NDArray[np.floating]) -> NDArray[np.float32]:
    """Motion beats (Q,) within the 4 s from each of `starts_s` (N,): (N,)."""
    beats, starts = np.sort(beat_times_s), np.asarray(starts_s, np.float64)
    return (np.searchsorted(beats, starts + SEGMENT_S) - np.searchsorted(beats, starts)).astype(np.float32)


def _n_starts(duration_s: float) -> int:
    return int(max(0.0, (duration_s - SEGMENT_S) * RHYTHM_FPS + 1))


def _probability(songs: Sequence[StyleSong], balanced_genres: bool) -> NDArray[np.float64]:
    """Probabilities of drawing each song or take, with equally likely genres, or equally likely segments."""
    if balanced_genres:
        genres = np.array([song.genre for song in songs])
        weight = np.array([1.0 / np.sum(genres == genre) for genre in genres])
    else:
        weight = np.array([song.n_starts for song in songs], np.float64)
    result: NDArray[np.float64] = weight / np.sum(weight)
    return result


# Losses of the style networks: equation 1, and a contrastive loss across the batch.


def style_loss(
    music: Tensor,
    motion: Tensor,
    beat_count: Tensor,
    n_beats: Tensor,
    *,
    style_weight: float,
    beat_weight: float,
) -> Tensor:
    """Equation 1 of ChoreoGraph (section 3.1), mean over a batch of pairs.

    `music` and `motion` (B, 32) are style vectors. `beat_count` (B,) is predicted from the music, `n_beats`
    (B,) is counted in the motion. Constant embeddings minimise this loss, so add `contrastive_loss`.
    """
    distance = (music - motion).square().sum(dim=1).clamp_min(1e-12).sqrt()  # (B,)
    return (style_weight * distance + beat_weight * (beat_count - n_beats).abs()).mean()


def contrastive_loss(
    anchors: Tensor, others: Tensor, *, positive: Tensor, negative: Tensor, temperature: float
) -> Tensor:
    """How much nearer anchors are to their positives than to their negatives (not in the paper).

    `anchors` (A, 32) and `others` (B, 32) are unit vectors. `positive` and `negative` are boolean (A, B), and
    pairs in neither are ignored. Each positive is compared with all negatives of its anchor. Anchors without
    a negative are ignored.
    """
    logits = 2.0 * (anchors @ others.T - 1.0) / temperature  # minus the squared distance, (A, B)
    against = logits.masked_fill(~negative, -1e9).logsumexp(dim=1, keepdim=True)  # (A, 1)
    valid = positive & negative.any(dim=1, keepdim=True)
    losses = functional.softplus(against - logits)  # (A, B)
    return (losses * valid).sum() / valid.sum().clamp_min(1)


# Training of the style networks on paired takes.


def train_style(
    takes: Sequence[StyleTake],
    config: StyleConfig,
    *,
    seed: int,
    songs: Sequence[StyleSong] = (),
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray[Any]] | None = None,
) -> StyleNets:
    """Train both embeddings and the beat-count head together (ChoreoGraph, section 3.1).

    All songs are used for training, without early stopping. On five held-out songs, the share of clips of the
    right genre was 0.558. With early stopping by validation loss it was 0.565, and by validation retrieval
    0.497.

    Parameters
    ----------
    takes : pairs of music and motion of at least two songs
    songs : music without dances, with known genres
    pretrained : weights of the same configuration to start from (`StyleNets.to_arrays`)
    context : checkpoints, log, device and progress (`nets.training`)

    Raises
    ------
    ParameterError   fewer than two songs have 4 s of pairs, or `pretrained` has another shape
    """
    data = StyleData(takes, songs, balanced_genres=config.balanced_genres)
    with forked_rng():
        torch.manual_seed(seed)
        nets = StyleNets(config)
    if pretrained is not None:
        load_pretrained(nets, "style", pretrained)
    nets.load_state_dict({name: torch.as_tensor(v) for name, v in data.statistics().items()}, strict=False)

    def batch(rng: np.random.Generator) -> StyleBatch:
        return data.batch(
            config.batch_size,
            rng,
            mirrored_share=config.mirrored_share,
            augmented=config.augmented,
            with_mel="mel" in nets.music.inputs,
        )

    def loss(batch: StyleBatch, device: torch.device) -> Tensor:
        return pair_loss(nets, batch.to(device))

    n_steps = config.steps
    if config.epochs:
        n_steps = steps_of_epochs(config.epochs, data.n_segments, config.batch_size)

    train(
        nets,
        loss,
        name="style",
        n_steps=n_steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        schedule=config.schedule,
        seed=seed,
        configuration={**asdict(config), "takes": sorted(song.name for song in (*takes, *songs))},
        context=context,
        prepare=batch,
    )
    return nets


def pair_loss(nets: StyleNets, batch: StyleBatch) -> Tensor:
    """Equation 1 and, unless `settings.loss` is "paper", contrast between songs and between genres."""
    config = nets.config
    all_music = gathered(nets.style_of_music(own_rows(batch.mel), own_rows(batch.rhythm)))  # (B + S, 32)
    motion = gathered(nets.style_of_motion(own_rows(batch.body)))
    music = all_music[: len(motion)]
    loss: Tensor = style_loss(
        music,
        motion,
        nets.beat_count(music),
        batch.n_beats,
        style_weight=config.style_weight,
        beat_weight=config.beat_weight,
    )
    if config.loss == "paper":
        return loss
    same_song = batch.song[:, None] == batch.song[None]  # (B, B)
    own = torch.eye(len(music), dtype=torch.bool, device=music.device)
    for anchors, others in ((music, motion), (motion, music)):
        loss = loss + 0.5 * config.contrast_weight * contrastive_loss(
            anchors, others, positive=own, negative=~same_song, temperature=config.temperature
        )
    # Genres are also contrasted within music and within motion, so that each network learns them separately.
    # With contrast across both alone, training starts without a useful gradient.
    both = torch.cat([all_music, motion])  # (2B + S, 32)
    genre = torch.cat([batch.genre, batch.genre[: len(motion)]])
    known = (genre >= 0)[:, None] & (genre >= 0)[None]
    same_genre = genre[:, None] == genre[None]
    same = torch.eye(len(both), dtype=torch.bool, device=both.device)
    result: Tensor = loss + config.genre_weight * contrastive_loss(
        both,
        both,
        positive=known & same_genre & ~same,
        negative=known & ~same_genre,
        temperature=config.temperature,
    )
    return result
