"""Song styles of the genres, by name."""

from choreograph.synthesis.songs.genres.ballroom import SWING, TANGO, WALTZ
from choreograph.synthesis.songs.genres.club import DISCO, FUNK, HOUSE
from choreograph.synthesis.songs.genres.latin import CHA_CHA, RUMBA, SALSA
from choreograph.synthesis.songs.genres.slow import CONTEMPORARY, HIP_HOP
from choreograph.synthesis.songs.style import SongStyle

_ALL = (HOUSE, HIP_HOP, DISCO, FUNK, CONTEMPORARY, CHA_CHA, SALSA, RUMBA, TANGO, WALTZ, SWING)
STYLES: dict[str, SongStyle] = {style.name: style for style in _ALL}
