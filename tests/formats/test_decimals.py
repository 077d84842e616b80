"""Numbers as text with five decimals, equal to those of Python to the character."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.formats import decimals
from choreograph.formats.decimals import DecimalRows

RNG = np.random.default_rng(0)
ROWS = {
    "angles": RNG.uniform(-540.0, 540.0, (400, 9)),
    "small": RNG.normal(0.0, 1e-5, (400, 3)),
    "zeros": np.array([[0.0, -0.0, -1e-9, 1e-9, 5e-6, -5e-6, 0.99999499999, 0.999995]]),
    "middles": (np.arange(600).reshape(200, 3) + 0.5) * 1e-5,
    "large": RNG.uniform(-3e6, 3e6, (100, 2)),
    "ends": np.array([[999_999.999994, -999_999.999996], [1e6, 1.0], [2.0, 1e300], [9.999995, 10.0]]),
    "no rows": np.zeros((0, 4)),
    "eighths": np.arange(-4000, 4000).reshape(-1, 8) / 8e5,
}


@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("many", [0, 1 << 18])
def test_the_characters_are_those_of_python(name, many, monkeypatch):
    monkeypatch.setattr(decimals, "_MANY", many)
    rows = ROWS[name]
    expected = "".join(" ".join(f"{number:.5f}" for number in row) + "\n" for row in rows.tolist())
    assert DecimalRows(rows.size).text(rows).decode() == expected
    parts = [DecimalRows(rows.size).text(part) for part in np.array_split(rows, 3)]
    assert b"".join(parts).decode() == expected
