"""How stages report what they are doing."""

from __future__ import annotations

from collections.abc import Callable

# Called with the stage's name, how much is done, and of how much; 0 for a total that is not known.
ProgressReport = Callable[[str, int, int], None]
