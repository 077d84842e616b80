"""The genres as data, by name."""

from choreograph.starter.synth.genres.ballroom import SWING, TANGO, WALTZ
from choreograph.starter.synth.genres.club import DISCO, FUNK, HOUSE
from choreograph.starter.synth.genres.latin import CHA_CHA, RUMBA, SALSA
from choreograph.starter.synth.genres.slow import CONTEMPORARY, HIP_HOP
from choreograph.starter.synth.style import SongStyle

_ALL = (HOUSE, HIP_HOP, DISCO, FUNK, CONTEMPORARY, CHA_CHA, SALSA, RUMBA, TANGO, WALTZ, SWING)
STYLES: dict[str, SongStyle] = {style.name: style for style in _ALL}
