"""Formations: spacing, symmetry, nobody behind another one, files of places."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.choreography.scenes import FORMATIONS, eye_of, formation_places, in_windows
from choreograph.core.errors import FormatError, ParameterError


@pytest.mark.parametrize("name", FORMATIONS)
@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 8])
def test_a_formation_is_symmetric_with_neighbours_a_spacing_apart(name, n):
    places, in_metres = formation_places(name, n)
    assert places.shape == (n, 2) and not in_metres
    on_axis = n % 2
    assert np.allclose(places[:on_axis, 0], 0.0)
    right, left = places[on_axis::2], places[on_axis + 1 :: 2]
    assert np.allclose(right, left * [-1.0, 1.0]) and (right[:, 0] > 0).all()
    away = np.linalg.norm(places[:, None] - places[None], axis=-1) + 9.0 * np.eye(n)
    assert away.min() >= 0.99 or n == 1


@pytest.mark.parametrize("name", FORMATIONS)
@pytest.mark.parametrize("n", [4, 5, 8, 12])
def test_nobody_stands_behind_another_one(name, n):
    places_m = in_windows(2.0 * formation_places(name, n)[0])
    eye = eye_of(places_m)
    away = eye[1] - places_m[:, 1]
    seen = places_m[:, 0] / away
    for front in range(n):
        for back in np.flatnonzero(away > away[front] + 0.4):
            assert abs(seen[back] - seen[front]) * away[back] > 0.35
    on_axis = n % 2
    assert np.allclose(places_m[on_axis::2], places_m[on_axis + 1 :: 2] * [-1.0, 1.0])


def test_places_of_a_file_are_in_metres(tmp_path):
    path = tmp_path / "places.json"
    path.write_text("[[0, 1], [2.5, -1]]")
    places, in_metres = formation_places(path, 2)
    assert in_metres and places.tolist() == [[0.0, 1.0], [2.5, -1.0]]
    with pytest.raises(ParameterError, match="expected 3 places, one for each dancer, got 2"):
        formation_places(path, 3)
    for text in ("", "{}", "[[1]]", '[["a", 2], [1, 2]]', "[[1, 1e9], [1, 2]]", "[[NaN, 1], [1, 2]]"):
        path.write_text(text)
        with pytest.raises(FormatError):
            formation_places(path, 2)


@pytest.mark.parametrize("name", ["star", "", "places.csv", "vv"])
def test_another_name_is_refused(name):
    with pytest.raises(ParameterError, match="expected a formation among line, v, circle, pairs"):
        formation_places(name, 4)
