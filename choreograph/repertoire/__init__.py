"""The repertoire: one HDF5 file with everything that `dance` needs besides the song.

- `repertoire` — `Repertoire`, an open file as takes, clips and motions
- `take_info` — what the file says about its takes
- `clip_motion` — how the clips move, frame by frame
- `clip_ranks` — how lively and how densely stepped clips are
- `contents` — takes and their features as the arrays of a file
- `motif_arrays` — a vocabulary as arrays, and back with every property checked
- `schema` — the layout of a file
- `store` — reading and writing files, the only user of h5py
"""

from choreograph.repertoire.repertoire import Repertoire
from choreograph.repertoire.store import Contents, NetArrays, write_repertoire
from choreograph.repertoire.take_info import TakeInfo

__all__ = ["Contents", "NetArrays", "Repertoire", "TakeInfo", "write_repertoire"]
