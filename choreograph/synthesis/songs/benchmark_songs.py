"""Songs with ground truth for tests and benchmarks; none of them is a song of the built-in takes.

Their seeds start at `FIRST_SEED` and those of the takes' songs are below, so neither the networks nor the
settings of the engine were trained or tuned on them. They are rendered on demand, in half a second each.
"""

from __future__ import annotations

from dataclasses import dataclass

from choreograph.synthesis.songs.song import SyntheticSong, render_song

FIRST_SEED = 1000
_DURATION_S = 50.0


@dataclass(frozen=True)
class BenchmarkSong:
    """Parameters of one benchmark song."""

    name: str
    group: str  # steady, ramp, swung
    genre: str
    bpm: float
    seed: int
    ramp_to_bpm: float | None = None
    swing: float = 0.0

    def render(self) -> SyntheticSong:
        """Render about 50 s."""
        return render_song(
            self.genre,
            bpm=self.bpm,
            duration_s=_DURATION_S,
            seed=self.seed,
            swing=self.swing,
            ramp_to_bpm=self.ramp_to_bpm,
        )


BENCHMARK_SONGS = (
    BenchmarkSong("steady hip-hop 85", "steady", "hip-hop", 85.0, 1000),
    BenchmarkSong("steady contemporary 90", "steady", "contemporary", 90.0, 1001),
    BenchmarkSong("steady rumba 100", "steady", "rumba", 100.0, 1002),
    BenchmarkSong("steady funk 106", "steady", "funk", 106.0, 1003),
    BenchmarkSong("steady disco 114", "steady", "disco", 114.0, 1004),
    BenchmarkSong("steady cha-cha 120", "steady", "cha-cha", 120.0, 1005),
    BenchmarkSong("steady house 125", "steady", "house", 125.0, 1006),
    BenchmarkSong("steady tango 131", "steady", "tango", 131.0, 1007),
    BenchmarkSong("steady waltz 152", "steady", "waltz", 152.0, 1008),
    BenchmarkSong("steady salsa 168", "steady", "salsa", 168.0, 1009),
    BenchmarkSong("ramp house 90-140", "ramp", "house", 90.0, 1010, ramp_to_bpm=140.0),
    BenchmarkSong("ramp disco 90-140", "ramp", "disco", 90.0, 1011, ramp_to_bpm=140.0),
    BenchmarkSong("ramp cha-cha 90-140", "ramp", "cha-cha", 90.0, 1012, ramp_to_bpm=140.0),
    BenchmarkSong("ramp tango 90-140", "ramp", "tango", 90.0, 1013, ramp_to_bpm=140.0),
    BenchmarkSong("swung hip-hop 94", "swung", "hip-hop", 94.0, 1014, swing=0.8),
    BenchmarkSong("swung house 121", "swung", "house", 121.0, 1015, swing=0.7),
    BenchmarkSong("swung swing 132", "swung", "swing", 132.0, 1016, swing=1.0),
    BenchmarkSong("swung swing 148", "swung", "swing", 148.0, 1017, swing=0.9),
)
