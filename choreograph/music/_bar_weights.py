"""Weights of `music.bars`, written by `research/fit_bars.py`."""

import numpy as np

# Log evidence of an accent for beats 1, 2, 3 of three and 1, 2, 3, 4 of four.
ACCENT_WEIGHTS = np.array(
    [
        [0.030, -0.066, 0.035, 0.035, -0.111, 0.028, 0.049],  # kick on the beat
        [0.032, 0.007, -0.038, 0.020, -0.037, 0.011, 0.006],  # bass on the beat
        [0.043, -0.046, 0.008, 0.052, -0.074, 0.003, 0.014],  # chords on the beat
        [-0.002, -0.029, 0.035, -0.005, 0.001, -0.025, 0.026],  # melody on the beat
        [-0.067, 0.031, 0.040, -0.051, 0.076, -0.072, 0.042],  # high on the beat
        [-0.049, 0.042, 0.004, -0.047, 0.057, -0.026, 0.019],  # kick off the beat
        [-0.077, 0.066, 0.005, -0.084, 0.031, 0.037, 0.022],  # bass off the beat
        [-0.041, 0.007, 0.033, -0.021, 0.041, -0.005, -0.014],  # chords off the beat
        [-0.017, -0.005, 0.020, 0.012, 0.021, -0.009, -0.021],  # melody off the beat
        [-0.037, -0.011, 0.043, -0.054, 0.013, -0.017, 0.062],  # high off the beat
        [0.065, -0.039, -0.029, 0.085, -0.072, -0.036, 0.026],  # kick level
        [-0.015, -0.031, 0.041, -0.040, -0.043, 0.016, 0.070],  # bass level
        [0.050, -0.043, -0.009, 0.056, -0.009, -0.032, -0.014],  # chords level
        [0.003, -0.026, 0.021, 0.019, -0.013, -0.029, 0.025],  # melody level
        [-0.047, -0.009, 0.052, -0.010, -0.005, -0.034, 0.053],  # high level
        [0.105, -0.024, -0.081, 0.142, -0.010, -0.065, -0.067],  # harmony change
        [0.132, -0.064, -0.065, 0.176, 0.012, -0.165, -0.027],  # harmony change over two beats
        [0.032, -0.025, -0.005, 0.035, -0.034, -0.026, 0.023],  # bass change
        [0.127, -0.039, -0.093, 0.185, -0.069, -0.049, -0.062],  # timbre change
        [0.027, 0.006, -0.036, -0.022, 0.009, -0.002, 0.019],  # bass in harmony
    ]
)  # (20, 7)
# Log evidence of a repeat for three rather than four. The last is added at every beat.
METRE_WEIGHTS = np.array(
    [
        -0.0196,  # low accents, 2 beats
        0.0576,  # low accents, 3 beats
        -0.0656,  # low accents, 4 beats
        0.0511,  # low accents, 6 beats
        -0.0563,  # low accents, 8 beats
        -0.0178,  # high accents, 2 beats
        0.0489,  # high accents, 3 beats
        -0.0498,  # high accents, 4 beats
        0.0346,  # high accents, 6 beats
        -0.0509,  # high accents, 8 beats
        -0.0129,  # levels, 2 beats
        0.0307,  # levels, 3 beats
        -0.0281,  # levels, 4 beats
        0.0328,  # levels, 6 beats
        -0.0339,  # levels, 8 beats
        -0.0067,  # changes, 2 beats
        0.0480,  # changes, 3 beats
        -0.0558,  # changes, 4 beats
        0.0612,  # changes, 6 beats
        -0.0596,  # changes, 8 beats
        -0.0132,  # harmony, 2 beats
        -0.0024,  # harmony, 3 beats
        -0.0204,  # harmony, 4 beats
        0.0134,  # harmony, 6 beats
        -0.0158,  # harmony, 8 beats
        -0.0162,  # timbre, 2 beats
        0.0015,  # timbre, 3 beats
        -0.0196,  # timbre, 4 beats
        0.0158,  # timbre, 6 beats
        -0.0136,  # timbre, 8 beats
        -0.0046,  # always
    ]
)  # (31,)
# Log odds that bars are right: offset, and slope in their margin over the root of the beats, in nats.
CONFIDENCE = (-2.53, 7.53)
