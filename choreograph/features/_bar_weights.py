"""Weights of the bar tracker, written by `examples/papers/fit_bars.py`: see there and `features.bars`."""

import numpy as np

# Log evidence of an accent for beats 1, 2, 3 of three and 1, 2, 3, 4 of four.
ACCENT_WEIGHTS = np.array(
    [
        [0.030, -0.058, 0.032, 0.038, -0.112, 0.015, 0.055],  # kick on the beat
        [0.023, 0.005, -0.021, 0.022, -0.046, 0.017, -0.000],  # bass on the beat
        [0.042, -0.034, 0.000, 0.055, -0.073, 0.003, 0.006],  # chords on the beat
        [-0.014, -0.013, 0.028, -0.001, 0.005, -0.031, 0.026],  # melody on the beat
        [-0.064, 0.025, 0.042, -0.054, 0.080, -0.074, 0.046],  # high on the beat
        [-0.057, 0.041, 0.013, -0.050, 0.061, -0.021, 0.012],  # kick off the beat
        [-0.068, 0.070, -0.004, -0.077, 0.033, 0.028, 0.018],  # bass off the beat
        [-0.035, 0.014, 0.022, -0.025, 0.039, 0.001, -0.015],  # chords off the beat
        [-0.014, 0.001, 0.014, 0.011, 0.025, -0.005, -0.033],  # melody off the beat
        [-0.031, -0.003, 0.038, -0.057, 0.010, -0.014, 0.059],  # high off the beat
        [0.075, -0.040, -0.032, 0.085, -0.070, -0.040, 0.021],  # kick level
        [-0.018, -0.017, 0.040, -0.044, -0.035, 0.011, 0.063],  # bass level
        [0.042, -0.029, -0.007, 0.055, -0.013, -0.035, -0.013],  # chords level
        [-0.003, -0.006, 0.015, 0.014, -0.012, -0.026, 0.018],  # melody level
        [-0.041, -0.006, 0.052, -0.018, -0.008, -0.026, 0.048],  # high level
        [0.103, -0.019, -0.083, 0.144, -0.003, -0.065, -0.078],  # harmony change
        [0.117, -0.060, -0.055, 0.174, 0.015, -0.168, -0.023],  # harmony change over two beats
        [0.038, -0.031, -0.007, 0.025, -0.029, -0.029, 0.033],  # bass change
        [0.147, -0.048, -0.103, 0.182, -0.063, -0.056, -0.060],  # timbre change
        [0.025, 0.018, -0.042, -0.042, 0.011, 0.012, 0.019],  # bass in harmony
    ]
)  # (20, 7)
# Log evidence of a repeat for three rather than four; the last is added at every beat.
METRE_WEIGHTS = np.array(
    [
        -0.0197,  # low accents, 2 beats
        0.0619,  # low accents, 3 beats
        -0.0659,  # low accents, 4 beats
        0.0530,  # low accents, 6 beats
        -0.0559,  # low accents, 8 beats
        -0.0241,  # high accents, 2 beats
        0.0524,  # high accents, 3 beats
        -0.0517,  # high accents, 4 beats
        0.0281,  # high accents, 6 beats
        -0.0552,  # high accents, 8 beats
        -0.0125,  # levels, 2 beats
        0.0337,  # levels, 3 beats
        -0.0240,  # levels, 4 beats
        0.0342,  # levels, 6 beats
        -0.0291,  # levels, 8 beats
        -0.0035,  # changes, 2 beats
        0.0494,  # changes, 3 beats
        -0.0500,  # changes, 4 beats
        0.0589,  # changes, 6 beats
        -0.0570,  # changes, 8 beats
        -0.0095,  # harmony, 2 beats
        0.0013,  # harmony, 3 beats
        -0.0162,  # harmony, 4 beats
        0.0149,  # harmony, 6 beats
        -0.0128,  # harmony, 8 beats
        -0.0164,  # timbre, 2 beats
        0.0035,  # timbre, 3 beats
        -0.0179,  # timbre, 4 beats
        0.0172,  # timbre, 6 beats
        -0.0093,  # timbre, 8 beats
        -0.0071,  # always
    ]
)  # (31,)
