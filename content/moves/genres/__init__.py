"""One module per genre: its moves as data, and a `Genre` with the manner of dancing."""

from content.moves.genres.cha_cha import CHA_CHA
from content.moves.genres.charleston import CHARLESTON
from content.moves.genres.contemporary import CONTEMPORARY
from content.moves.genres.disco import DISCO
from content.moves.genres.funk import FUNK
from content.moves.genres.hip_hop import HIP_HOP
from content.moves.genres.house import HOUSE
from content.moves.genres.jive import JIVE
from content.moves.genres.pop import POP
from content.moves.genres.rumba import RUMBA
from content.moves.genres.salsa import SALSA
from content.moves.genres.swing import SWING
from content.moves.genres.tango import TANGO
from content.moves.genres.viennese_waltz import VIENNESE_WALTZ
from content.moves.genres.waltz import WALTZ

GENRES = {
    genre.name: genre
    for genre in (
        HOUSE,
        HIP_HOP,
        CONTEMPORARY,
        DISCO,
        POP,
        FUNK,
        CHA_CHA,
        RUMBA,
        SALSA,
        WALTZ,
        VIENNESE_WALTZ,
        TANGO,
        SWING,
        JIVE,
        CHARLESTON,
    )
}
