"""The repertoire: one HDF5 file with all that `dance` needs beside the song."""

from choreograph.repertoire.repertoire import Repertoire, TakeInfo
from choreograph.repertoire.store import Contents, NetArrays, write_repertoire

__all__ = ["Contents", "NetArrays", "Repertoire", "TakeInfo", "write_repertoire"]
