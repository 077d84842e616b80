"""Songs with a known truth for tests and benchmarks; none of them is a song of the starter's takes.

Their seeds begin at `FIRST_SEED`, the takes' songs stay below it, so the networks and the settings of
the engine have never heard these. They are rendered when asked for, half a second each.
"""

from __future__ import annotations

from dataclasses import dataclass

from choreograph.synthesis.songs.song import SynthSong, render_song

FIRST_SEED = 1000
_DURATION_S = 50.0


@dataclass(frozen=True)
class BenchSong:
    """How to render one song of the test bed."""

    name: str
    group: str  # steady, ramp, swung
    genre: str
    bpm: float
    seed: int
    ramp_to_bpm: float | None = None
    swing: float = 0.0

    def render(self) -> SynthSong:
        """About 50 s of it."""
        return render_song(
            self.genre,
            bpm=self.bpm,
            duration_s=_DURATION_S,
            seed=self.seed,
            swing=self.swing,
            ramp_to_bpm=self.ramp_to_bpm,
        )


SONGS = (
    BenchSong("steady hip-hop 85", "steady", "hip-hop", 85.0, 1000),
    BenchSong("steady contemporary 90", "steady", "contemporary", 90.0, 1001),
    BenchSong("steady rumba 100", "steady", "rumba", 100.0, 1002),
    BenchSong("steady funk 106", "steady", "funk", 106.0, 1003),
    BenchSong("steady disco 114", "steady", "disco", 114.0, 1004),
    BenchSong("steady cha-cha 120", "steady", "cha-cha", 120.0, 1005),
    BenchSong("steady house 125", "steady", "house", 125.0, 1006),
    BenchSong("steady tango 131", "steady", "tango", 131.0, 1007),
    BenchSong("steady waltz 152", "steady", "waltz", 152.0, 1008),
    BenchSong("steady salsa 168", "steady", "salsa", 168.0, 1009),
    BenchSong("ramp house 90-140", "ramp", "house", 90.0, 1010, ramp_to_bpm=140.0),
    BenchSong("ramp disco 90-140", "ramp", "disco", 90.0, 1011, ramp_to_bpm=140.0),
    BenchSong("ramp cha-cha 90-140", "ramp", "cha-cha", 90.0, 1012, ramp_to_bpm=140.0),
    BenchSong("ramp tango 90-140", "ramp", "tango", 90.0, 1013, ramp_to_bpm=140.0),
    BenchSong("swung hip-hop 94", "swung", "hip-hop", 94.0, 1014, swing=0.8),
    BenchSong("swung house 121", "swung", "house", 121.0, 1015, swing=0.7),
    BenchSong("swung swing 132", "swung", "swing", 132.0, 1016, swing=1.0),
    BenchSong("swung swing 148", "swung", "swing", 148.0, 1017, swing=0.9),
)
