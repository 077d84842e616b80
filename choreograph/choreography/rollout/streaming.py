"""The dance of the rollout network pose by pose: drawn motifs, a path on the stage, and locked feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.material import takes_of_genre
from choreograph.choreography.motif_sequences import draw_next_motif, motif_goal, possible_motifs
from choreograph.choreography.passages import DancedSoFar, TakeWords, draw_passage, passage_stop
from choreograph.choreography.rollout.generation import (
    SEED_FRAMES,
    SHIFT_S,
    SMOOTH_HEADING_S,
    STEER_FRAMES,
    check_skeleton,
)
from choreograph.core.arguments import as_index
from choreograph.core.counts import UNKNOWN, Counts, bar_positions, count_numbers
from choreograph.core.numerics import AnyFloats, Floats, Indices
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import DEFAULT_WORD_S, dance_bounds_s
from choreograph.motion import rotations as rot
from choreograph.motion.contacts import FootLockStream
from choreograph.motion.motion import Motion
from choreograph.nets.rollout_poses import (
    N_FEET,
    ROLLOUT_FPS,
    ROOT_DIM,
    PosePredictor,
    RolloutConditions,
    to_poses,
)
from choreograph.plan.joins import steer_rad

# Motifs drawn while a song plays, passage by passage or word by word (Rhythm is a Dancer, section 4.3).


_LAST_WORDS = 8  # whose median is the duration of words after the last count
_NO_WORD = -1


@dataclass(frozen=True)
class StreamedWord:
    """A word of a streamed dance, and the motif, or the word of a take, on which it is conditioned."""

    start_s: float
    """When it begins in the song, in seconds."""

    end_s: float
    """When it ends in the song, in seconds."""

    motif: int
    """Index of the motif in the vocabulary."""

    word: int = _NO_WORD
    """Index of the word in the vocabulary, or -1 for a motif that was requested or drawn alone."""


class MotifStream:
    """An endless sequence of words from the start of a song on.

    Before and after the counts of the song, words are evenly spaced. Motifs are drawn in passages of about
    `phrase_counts` counts, as by `choreography.passages`, or one by one if it is 1. A motif is then drawn
    only if it has a word on the count where the next word begins. `need` is the reading of equation 5, as in
    `choreography.motif_sequences.draw_motifs`. Setting `genre` restarts its signature and begins another
    passage. Raises `ParameterError` for an unknown genre, and `RepertoireError` without motifs.
    """

    def __init__(
        self,
        counts: Counts,
        repertoire: Repertoire,
        *,
        genre: str,
        seed: int,
        need: str = "missing",
        phrase_counts: int = 16,
    ) -> None:
        self._repertoire, self._vocabulary = repertoire, repertoire.vocabulary
        self._need, self._rng, self._phrase_counts = need, np.random.default_rng(seed), phrase_counts
        last_s = counts.times_s[-1] if len(counts) else 0.0
        self._bounds_s = dance_bounds_s(counts.times_s, max(float(last_s), DEFAULT_WORD_S))
        self._last_word_s = float(np.median(np.diff(self._bounds_s)[-_LAST_WORDS:]))
        self._position = bar_positions(self._bounds_s, counts)
        self._bars = np.flatnonzero(count_numbers(self._position) == 1)
        self._words = TakeWords.of(repertoire)
        self._requested: list[tuple[int, int]] = []  # motifs without a word
        self.words: list[StreamedWord] = []  # begun so far
        self.genre = genre

    @property
    def genre(self) -> str:
        """The genre whose signature and transitions are danced."""
        return self._genre

    @genre.setter
    def genre(self, genre: str) -> None:
        self._goal = motif_goal(self._vocabulary, genre=genre)
        self._genre = genre
        self._takes = takes_of_genre(self._repertoire, genre)
        self._passage: list[tuple[int, int]] = []  # motifs and words of the rest of the drawn passage
        self._danced = np.zeros(self._vocabulary.n_motifs)

    def request(self, motif: int, n_words: int) -> None:
        """Dance a motif in the next words, instead of those that were requested for them."""
        self._requested = [(as_index("a motif", motif, self._vocabulary.n_motifs), _NO_WORD)] * n_words

    def begin_word(self) -> StreamedWord:
        """The next word, with its motif requested or drawn."""
        slot = len(self.words)
        if not self._passage and not self._requested:
            self._passage = self._drawn(slot)
        motif, word = (self._requested or self._passage)[0]
        del self._passage[:1], self._requested[:1]
        self._danced[motif] += 1
        self.words.append(StreamedWord(self._bound_s(slot), self._bound_s(slot + 1), motif, word))
        return self.words[-1]

    def _drawn(self, slot: int) -> list[tuple[int, int]]:
        """The motifs and words of a passage that begins at a slot, or of one motif."""
        previous = self.words[-1].motif if self.words else None
        if self._phrase_counts > 1:
            stop = passage_stop(slot, slot + 2 * self._phrase_counts, self._bars, self._phrase_counts)
            position, possible = self._slots(slot, stop)
            drawn = draw_passage(
                self._words, self._goal, DancedSoFar(self._danced, previous=previous),
                slot_position=position, takes=self._takes, allowed=possible, need=self._need, rng=self._rng,
            )  # fmt: skip
            if drawn is not None:
                same = np.arange(self._vocabulary.n_motifs) == drawn[:, None]  # (L, K)
                words = self._words.runs(position, self._takes, same)[0]
                return list(zip(drawn.tolist(), words.tolist(), strict=True))
        _, possible = self._slots(slot, slot + 2)
        motif = draw_next_motif(
            self._danced,
            self._goal.signature,
            self._goal.transitions,
            rng=self._rng,
            previous=previous,
            possible=possible,
            need=self._need,
        )
        return [(motif, _NO_WORD)]

    def _slots(self, start: int, stop: int) -> tuple[Indices, NDArray[np.bool_]]:
        """Positions in the bar (L,) of words from one slot to another, and their possible motifs (L, K)."""
        position = np.full(stop - start, UNKNOWN)
        here = self._position[start:stop]
        position[: len(here)] = here
        takes = np.tile(self._takes, (stop - start, 1))
        return position, possible_motifs(position, self._words.position, takes, self._vocabulary)

    def _bound_s(self, index: int) -> float:
        beyond = index - (len(self._bounds_s) - 1)
        return float(self._bounds_s[min(index, len(self._bounds_s) - 1)]) + max(0, beyond) * self._last_word_s


# The path of a dance on the stage, and its poses at any rate, while the network predicts it.
#
# These are the steps of `generation` for a whole dance, but frame by frame with two frames of future (67 ms):
#
# - The heading is smoothed by the same Gaussian, cut off one frame ahead, so that it lags by about 35 ms.
# - The path is steered back to the stage word by word, by the direction of the last two seconds instead of
#   the next two.
# - Poses follow a cubic B-spline whose control points are the poses of the network. It smooths like the
#   Gaussian there (a deviation of 0.577 frames, 19 ms), and like the spline there at any rate.


FUTURE_FRAMES = 3  # that poses wait for: two control points, and one frame more for the heading of the last
_UP = np.array([0.0, 1.0, 0.0])
_PAST_FRAMES = 10  # of the heading's Gaussian, four deviations
_DEVIATIONS = np.arange(-_PAST_FRAMES, 2) / (SMOOTH_HEADING_S * ROLLOUT_FPS)
_HEADING_WEIGHTS = np.exp(-0.5 * _DEVIATIONS**2) / np.exp(-0.5 * _DEVIATIONS**2).sum()  # (12,)


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses in the world, and the contacts the network predicts for them."""

    root_pos_m: Floats  # (T, 3)
    local_quat: Floats  # (T, J, 4)
    contacts: Floats  # (T, 2) of the left and the right foot, 0 to 1


class StagePath:
    """Poses in the world from pose rows (P,), added one by one from frame 0 on, above the origin."""

    def __init__(self) -> None:
        self._row: Floats | None = None  # the last one added
        self._turns: list[float] = []  # changes of heading of the last frames added
        self._steer: list[float] = []  # extra changes of heading, of the next frames to be placed
        self._heading = 0.0
        self._pos_m = np.zeros(3)  # on the ground
        self._travelled: list[Floats] = []  # positions of the last two seconds
        self._root_pos_m: list[Floats] = []  # control points, the last four
        self._headings: list[Floats] = []
        self._quats: list[Floats] = []  # (J, 4), the root's without its heading
        self._contacts: list[Floats] = []

    def begin_word(self, n_frames: int) -> None:
        """Begin a word of `n_frames` frames. A path that leaves the stage is bent back within it."""
        before = self._travelled[0] if self._travelled else self._pos_m
        window = np.hanning(n_frames + 2)[1:-1]
        angle = steer_rad(self._pos_m, self._pos_m - before)
        self._steer = (angle * window / max(window.sum(), 1e-9)).tolist()

    def add(self, row: NDArray[np.floating]) -> None:
        """Add the next pose row, and place the frame before it on the stage."""
        pose = np.asarray(row, np.float64)
        self._turns.append(float(pose[3]) if self._row is not None else 0.0)
        if self._row is not None:
            self._place(self._row)
        self._row = pose

    def _place(self, row: Floats) -> None:
        """Place the pose before the last one added: the control point of its frame."""
        if self._root_pos_m:
            shift = rot.rotate(rot.about_y(self._heading), np.array([row[0], 0.0, row[1]]))
            self._pos_m = self._pos_m + shift
            turns = self._turns[-_PAST_FRAMES - 2 :]
            weights = _HEADING_WEIGHTS[-len(turns) :]
            self._heading += float(np.dot(turns, weights) / weights.sum())
            self._heading += self._steer.pop(0) if self._steer else 0.0
        self._turns = self._turns[-_PAST_FRAMES - 2 :]
        self._travelled = [*self._travelled[-STEER_FRAMES:], self._pos_m]
        quat = rot.normalize(row[ROOT_DIM:-N_FEET].reshape(-1, 4))
        if self._quats:
            quat = np.where(np.sum(quat * self._quats[-1], axis=-1, keepdims=True) < 0, -quat, quat)
        control = (self._pos_m + row[2] * _UP, np.array(self._heading), quat, row[-N_FEET:])
        points = (self._root_pos_m, self._headings, self._quats, self._contacts)
        for values, value in zip(points, control, strict=True):
            values += [value] * (1 if values else 2)  # the first one is repeated before frame 0
            del values[:-4]

    def between(self, since: Floats) -> Poses:
        """Poses at shares (T,) of the frame that the last four control points lie around, 0 to 1."""
        weights = _spline_weights(since)  # (T, 4)
        quat = rot.normalize(np.einsum("tc,cjd->tjd", weights, np.stack(self._quats)))
        heading = weights @ np.array(self._headings)
        quat[:, 0] = rot.multiply(rot.about_y(heading), quat[:, 0])
        return Poses(weights @ np.stack(self._root_pos_m), quat, weights @ np.stack(self._contacts))


def _spline_weights(since: Floats) -> Floats:
    """Weights (T, 4) of the control points around a frame of a uniform cubic B-spline."""
    left = 1.0 - since
    return np.stack(
        [
            left**3,
            3.0 * since**3 - 6.0 * since**2 + 4.0,
            3.0 * left**3 - 6.0 * left**2 + 4.0,
            since**3,
        ],
        axis=1,
    ) / 6.0  # fmt: skip


# The dance of the rollout network, pose by pose.


POSES_AHEAD = FUTURE_FRAMES + 1  # of a final frame, whose feet are locked one pose later than it is sampled


@dataclass(frozen=True, eq=False)
class FrameCondition:
    """The conditions of one frame at 30 fps, a row of `RolloutConditions` without rhythm and style."""

    motif: NDArray[np.floating]  # (184,)
    progress: float
    word_s: float
    count_phase: NDArray[np.floating]  # (4,)

    def with_rhythm(self, rhythm: NDArray[np.floating]) -> RolloutConditions[AnyFloats]:
        """The frame's conditions (1, ...), with the rhythm (4,) some frames ahead."""
        rows = (self.motif, rhythm, self.progress, self.word_s, self.count_phase)
        motif, ahead, progress, word_s, phase = (np.asarray(row)[None] for row in rows)
        return RolloutConditions(motif, ahead, progress, word_s, phase, None)


class PoseStream:
    """Pose rows of the network, one for each frame's conditions, after recorded motion that leads up to them.

    Raises `ParameterError` if the skeleton of `seed_motion` is not the network's.
    """

    def __init__(self, net: PosePredictor, seed_motion: Motion) -> None:
        check_skeleton(net, seed_motion.skeleton)
        self._net = net
        self._state = net.initial_state()
        self._seed = to_poses(seed_motion)[-SEED_FRAMES:]
        self._pose: NDArray[np.float32] | None = None  # the last one

    def next_row(self, conditions: RolloutConditions[AnyFloats]) -> NDArray[np.float32]:
        """The pose row (P,) that follows, contacts as probabilities."""
        gate_inputs, embedded = (values[0] for values in self._net.embed_conditions(conditions))
        if self._pose is None:
            for row in self._seed[:-1]:
                _, self._state = self._net.step(row, gate_inputs, embedded, self._state)
            self._pose = self._seed[-1]
        self._pose, self._state = self._net.step(self._pose, gate_inputs, embedded, self._state)
        return self._pose


class DanceStream:
    """The dance of a network at `fps`, on its stage and with locked feet, while poses are predicted."""

    def __init__(self, net: PosePredictor, seed_motion: Motion, fps: float) -> None:
        self._poses = PoseStream(net, seed_motion)
        self._path = StagePath()
        self._feet = FootLockStream(seed_motion.skeleton, fps, SHIFT_S)
        self._fps = fps
        self._n_predicted, self._n_sampled = 0, 0  # poses at 30 fps, frames at `fps`
        self._pending: list[Poses] = []
        self._last_quat: Floats | None = None  # (1, J, 4), for continuous signs

    def begin_word(self, n_frames: int) -> None:
        """Begin a word of `n_frames` frames at 30 fps with the next condition."""
        self._path.begin_word(n_frames)

    def advance(self, condition: FrameCondition, rhythm: NDArray[np.floating]) -> list[tuple[Floats, Floats]]:
        """Predict one more pose. Return the frames that are now final, as root (3,) and rotations (J, 4).

        These are the frames from the pose `POSES_AHEAD` before it up to the next one.
        """
        self._path.add(self._poses.next_row(condition.with_rhythm(rhythm)))
        self._n_predicted += 1
        if self._n_predicted <= FUTURE_FRAMES:
            return []
        self._pending.append(self._sampled(self._n_predicted - 1 - FUTURE_FRAMES))
        if len(self._pending) < 2:
            return []
        done = self._pending.pop(0)
        if len(done.root_pos_m) == 0:
            return []
        quat = self._feet.pop(len(done.root_pos_m))
        before = quat[:1] if self._last_quat is None else self._last_quat
        quat = rot.make_continuous(np.concatenate([before, quat]))[1:]
        self._last_quat = quat[-1:]
        return list(zip(done.root_pos_m, quat, strict=True))

    def _sampled(self, pose: int) -> Poses:
        """Poses at the dance's frames from a pose of the network up to the next."""
        stop = int(np.ceil((pose + 1) * self._fps / ROLLOUT_FPS - 1e-6))
        frames = np.arange(self._n_sampled, stop)
        self._n_sampled = stop
        poses = self._path.between(frames * ROLLOUT_FPS / self._fps - pose)
        self._feet.push(poses.root_pos_m, poses.local_quat, poses.contacts)
        return poses
