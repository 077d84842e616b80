"""Styles in other metres and with other drums: their patterns, and what stays as it was."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from content.songs.metre_styles import METRE_STYLES
from content.songs.synthesis.song import STYLES, render_song
from content.songs.synthesis.style import SongStyle
from content.songs.training_songs import (
    double_time_drums,
    drums_of,
    half_time_drums,
    in_six,
    in_three,
    odd_metre_style,
    rebarred,
    reorchestrated,
)

FOURS = [style for style in STYLES.values() if style.beats_per_bar == 4]


def patterns(style: SongStyle) -> list[str]:
    fills = [pattern for _, pattern in style.fills]
    return [p for source in (*style.lanes, *style.parts) for p in source.patterns] + fills


@pytest.mark.parametrize("style", FOURS, ids=lambda style: style.name)
@pytest.mark.parametrize("dropped", [0, 1, 2, 3])
def test_in_three_every_pattern_has_whole_bars_of_three(style, dropped):
    three = in_three(style, dropped=dropped)
    assert three.beats_per_bar == 3
    assert all(len(p) % three.steps_per_bar == 0 for p in patterns(three))
    before = style.lanes[0].patterns[0][:16]
    kept = [before[4 * beat : 4 * beat + 4] for beat in range(4) if beat != dropped]
    assert three.lanes[0].patterns[0][:12] == "".join(kept)


def test_a_bar_is_made_of_beats_of_another():
    five = rebarred(STYLES["house"], (0, 1, 2, 0, 1), softer=(3,))
    assert five.beats_per_bar == 5 and all(len(p) % 20 == 0 for p in patterns(five))
    before, after = STYLES["house"].lanes[0].patterns[0], five.lanes[0].patterns[0]
    assert after[:12] == before[:12] and after[16:20] == before[4:8]
    assert after[12:16] == before[:4].translate(str.maketrans("Xx", "xo"))
    with pytest.raises(ParameterError, match="from 0 to 3"):
        rebarred(STYLES["house"], (0, 4))


@pytest.mark.parametrize("metre", [5, 6, 7])
def test_styles_in_odd_metres_are_drawn(metre):
    drawn = [odd_metre_style(metre, np.random.default_rng(seed)) for seed in range(8)]
    assert {style.beats_per_bar for _, style, _ in drawn} == {metre}
    assert len({style.name for _, style, _ in drawn}) > 4
    assert all(len(p) % (4 * metre) == 0 for _, style, _ in drawn for p in patterns(style))


@pytest.mark.parametrize("style", METRE_STYLES.values(), ids=lambda style: style.name)
def test_benchmark_styles_have_whole_bars(style):
    assert all(len(p) % style.steps_per_bar == 0 for p in patterns(style))
    assert {style.beats_per_bar for style in METRE_STYLES.values()} == {5, 6, 7}


def test_in_six_the_second_half_of_a_bar_is_softer():
    six = in_six(STYLES["waltz"])
    assert six.beats_per_bar == 6 and all(len(p) % 24 == 0 for p in patterns(six))
    assert six.lanes[0].patterns[0] == "X...........x..........."


def test_drums_at_half_and_double_time_keep_the_metre():
    house = STYLES["house"]
    assert half_time_drums(house).lanes[0].patterns[0] == "X.......X......." * 2
    assert double_time_drums(house).lanes[0].patterns[0] == "X.X.X.X." * 2
    for style in (half_time_drums(house), double_time_drums(house)):
        assert style.parts == house.parts and style.fills == house.fills


def test_drums_of_another_style():
    mixed = drums_of(STYLES["salsa"], STYLES["house"])
    assert mixed.lanes == STYLES["salsa"].lanes and mixed.parts == STYLES["house"].parts
    assert "salsa" in mixed.name and "house" in mixed.name


def test_another_metre_is_refused():
    with pytest.raises(ParameterError, match="in 4"):
        in_three(STYLES["waltz"], dropped=1)
    with pytest.raises(ParameterError, match="in 3"):
        in_six(STYLES["house"])
    with pytest.raises(ParameterError, match="in 4"):
        drums_of(STYLES["waltz"], STYLES["house"])


def test_reorchestration_follows_its_seed_and_keeps_every_part():
    voices = {role: ("piano", "organ") for role in ("bass", "chords", "melody")}
    style = STYLES["funk"]
    one, same, other = (reorchestrated(style, voices, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one == same and one != other
    assert [part.role for part in one.parts] == [part.role for part in style.parts]
    assert [part.patterns for part in one.parts] == [part.patterns for part in style.parts]


@pytest.mark.slow
@pytest.mark.parametrize("style", [in_three(STYLES["disco"], dropped=3), in_six(STYLES["waltz"])])
def test_a_song_in_another_metre_is_rendered(style):
    song = render_song(style, n_bars=8, seed=1)
    assert song.beats_per_bar == style.beats_per_bar and song.n_bars == 8
    assert np.abs(song.samples).max() > 0.1
