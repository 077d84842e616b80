"""A small composer and synthesiser of dance songs whose beats, bars and sections are known exactly.

`render_song` composes and renders a song; `write_song` writes it, optionally with its ground truth.

song             the two functions above
style, genres    what a genre is made of: drum lanes, parts, patterns, progressions
arrangement      sections
composition      notes of all tracks; `harmony` and `melody` choose their pitches
tempo            tempo maps and swing
drums, voices    synthesis of drum hits and notes
mixing, effects  from tracks to a mastered stereo song
benchmark_songs  the songs that tests and benchmarks use
spliced_songs    songs of two genres, to see whether a dance follows
"""

from choreograph.synthesis.songs.arrangement import Section
from choreograph.synthesis.songs.genres import STYLES
from choreograph.synthesis.songs.song import SyntheticSong, render_song, write_song
from choreograph.synthesis.songs.style import Lane, Part, SongStyle
from choreograph.synthesis.songs.tempo import TempoMap

__all__ = [
    "STYLES", "Lane", "Part", "Section", "SongStyle", "SyntheticSong", "TempoMap", "render_song",
    "write_song",
]  # fmt: skip
