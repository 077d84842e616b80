"""One module a genre: its moves as data, and a `Genre` that says how they are danced."""

from choreograph.starter.moves.genres.cha_cha import CHA_CHA
from choreograph.starter.moves.genres.contemporary import CONTEMPORARY
from choreograph.starter.moves.genres.disco import DISCO
from choreograph.starter.moves.genres.hip_hop import HIP_HOP
from choreograph.starter.moves.genres.house import HOUSE
from choreograph.starter.moves.genres.salsa import SALSA
from choreograph.starter.moves.genres.swing import SWING
from choreograph.starter.moves.genres.waltz import WALTZ

GENRES = {genre.name: genre for genre in (HOUSE, HIP_HOP, CONTEMPORARY, DISCO, CHA_CHA, SALSA, WALTZ, SWING)}
