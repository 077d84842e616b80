"""Trainings of the preset `tiny` that take a moment, for tests of everything but what is learned."""

from dataclasses import replace

from choreograph.nets import configs

STEPS = 10  # of every training


def shorten_trainings(steps: int = STEPS) -> None:
    """Shorten the trainings of this process; `conftest.short_trainings` does so for a module."""
    for presets in (configs._STYLE_PRESETS, configs._WORD_PRESETS, configs._ROLLOUT_PRESETS):
        presets["tiny"] = replace(presets["tiny"], steps=steps)
    density = configs._DENSITY_PRESETS
    density["tiny"] = replace(density["tiny"], steps=steps, music_steps=steps)
