"""The repertoire: one HDF5 file with everything that `dance` needs besides the song.

- `repertoire` — `Repertoire`, an open file as takes, clips and motions
- `take_info` — what the file says about its takes
- `clip_motion` — how the clips move, frame by frame
- `clip_ranks` — how lively and how densely stepped clips are
- `contents` — takes and their features as the arrays of a file
- `motif_arrays` — a vocabulary as arrays, and back with every property checked
- `schema` — the layout of a file
- `layout` — which arrays of what shapes belong to it, as plain data
- `store`, `writing` — files read and written
- `hdf5`, `checks` — files opened, and looked at before they are read: they may be a stranger's
"""

from choreograph.repertoire.layout import Contents, NetArrays
from choreograph.repertoire.repertoire import Repertoire
from choreograph.repertoire.take_info import TakeInfo
from choreograph.repertoire.writing import write_repertoire

__all__ = ["Contents", "NetArrays", "Repertoire", "TakeInfo", "write_repertoire"]
