"""A small synthesiser of dance songs whose beats, bars and sections are known exactly.

`render_song` composes and plays; `write_song` writes it and, if asked, the truth beside it;
`testbed` names the songs that tests and benchmarks use, `examples` the ones that are shipped.
"""

from choreograph.synthesis.songs.arrangement import Section
from choreograph.synthesis.songs.genres import STYLES
from choreograph.synthesis.songs.song import SynthSong, render_song, write_song
from choreograph.synthesis.songs.style import Lane, Part, SongStyle
from choreograph.synthesis.songs.tempo import TempoMap

__all__ = [
    "STYLES", "Lane", "Part", "Section", "SongStyle", "SynthSong", "TempoMap", "render_song", "write_song",
]  # fmt: skip
