"""The style of the songs of each danced genre. Some genres are danced to songs of another one, or faster."""

from __future__ import annotations

from dataclasses import replace

from content.songs.synthesis.song import STYLES
from content.songs.synthesis.style import Lane, SongStyle

_HOUSE = STYLES["house"]

# A chart song has the drums of a band, the parts of a club song, and the most usual chords.
POP = replace(
    _HOUSE,
    name="pop",
    bpm=(96.0, 126.0),
    swing=0.0,
    duck=0.25,
    lanes=(
        Lane(
            "kick", ("X.....x.X.......", "X..x....X.x.....", "X...x...X...x..."),
            enters=0.34, db=-4.5, send=0.0,
        ),
        Lane("snare", ("....X.......X...", "....X.......X..o"), enters=0.34, db=-7.0, send=0.18),
        Lane("hat", ("x.x.x.x.x.x.x.x.", "x.o.x.o.x.o.x.o."), enters=0.45, db=-10.0, pan=0.2),
        Lane("clap", ("....x.......x...",), enters=0.85, db=-12.0, send=0.25),
        Lane("open hat", ("..............x.",), enters=0.6, db=-11.0, pan=-0.2),
        Lane("snap", ("....x.......x...",), leaves=0.34, db=-11.0, send=0.3),
    ),
    progressions=("C G Am F", "Am F C G", "F G Am C", "C Am F G"),
    scales=("major pentatonic", "minor pentatonic"),
)  # fmt: skip

DANCED: dict[str, SongStyle] = {
    **{name: STYLES[name] for name in (
        "house", "hip-hop", "contemporary", "disco", "funk", "cha-cha", "rumba", "tango", "swing",
    )},
    "pop": POP,
    "waltz": replace(STYLES["waltz"], bpm=(84.0, 120.0)),
    "Viennese waltz": replace(STYLES["waltz"], name="Viennese waltz", bpm=(144.0, 180.0)),
    "jive": replace(STYLES["swing"], name="jive", bpm=(132.0, 176.0)),
    "Charleston": replace(STYLES["swing"], name="Charleston", bpm=(150.0, 204.0)),
    "salsa": replace(STYLES["salsa"], bpm=(156.0, 200.0)),
}  # fmt: skip
"""The style and the tempo range of the songs of each genre."""
