"""One module per genre: its moves as data, and a `Genre` with the manner of dancing."""

from choreograph.synthesis.moves.genres.cha_cha import CHA_CHA
from choreograph.synthesis.moves.genres.contemporary import CONTEMPORARY
from choreograph.synthesis.moves.genres.disco import DISCO
from choreograph.synthesis.moves.genres.hip_hop import HIP_HOP
from choreograph.synthesis.moves.genres.house import HOUSE
from choreograph.synthesis.moves.genres.salsa import SALSA
from choreograph.synthesis.moves.genres.swing import SWING
from choreograph.synthesis.moves.genres.waltz import WALTZ

GENRES = {genre.name: genre for genre in (HOUSE, HIP_HOP, CONTEMPORARY, DISCO, CHA_CHA, SALSA, WALTZ, SWING)}
