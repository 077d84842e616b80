"""Takes at other tempi: motion, music and phases stay together."""

import numpy as np
import pytest
from synthetic_rollouts import synthetic_takes

from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.nets.rollout_poses import ROLLOUT_FPS
from choreograph.nets.rollout_training import at_tempo


@pytest.mark.parametrize("tempo", [0.8, 1.25])
def test_a_take_at_another_tempo_is_danced_and_sounds_faster_together(tempo):
    take = synthetic_takes(1)[0]
    played = at_tempo(take, tempo)
    assert played.motion.n_frames == pytest.approx(take.motion.n_frames / tempo, abs=1)
    assert played.end_s == pytest.approx(take.end_s / tempo)
    beats = np.flatnonzero(played.rhythm[:, 3]) / ROLLOUT_FPS
    assert beats == pytest.approx(np.append(played.start_s, played.end_s[-1]), abs=0.5 / ROLLOUT_FPS + 1e-6)
    on_beats = played.count_phase[np.rint(beats * ROLLOUT_FPS).astype(int)]
    assert (on_beats[:, 0] > 0.9).all()  # cos of the phase of the beat
    # Arms are raised in the middle of a beat, and down on it.
    for take_, of in ((take, take.start_s), (played, played.start_s)):
        hands = body_pos_m(take_.motion)[:, BODY_JOINTS.index("left_wrist"), 1]
        frames = np.rint(of * ROLLOUT_FPS).astype(int)
        assert hands[frames].max() < hands.max() - 0.1


def test_the_take_at_its_own_tempo_is_itself():
    take = synthetic_takes(1)[0]
    assert at_tempo(take, 1.0) is take
