"""NPZ writer: plain arrays without pickles, also SMPL's if the skeleton is the canonical one."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from choreograph.exporters._base import DANCE_GENERATOR, GENERATOR, Writer
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS

_EPOCH = (
    1980,
    1,
    1,
    0,
    0,
    0,
)  # the earliest date of a zip entry, fixed so that the same motion gives the same bytes


class NpzWriter(Writer):
    """Writes arrays that `importers.npz.read_npz` reads back bit for bit.

    root_pos_m (T, 3), local_quat (T, J, 4) wxyz, fps, names (J,), parents (J,), offsets_m (J, 3),
    tip_parents (E,), tips_m (E, 3). On the canonical joints also SMPL's `poses` (T, 72), axis-angle,
    and `trans` (T, 3): the pelvis position, which in SMPL's own files is a constant vector off `trans`.
    """

    format = "npz"

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`."""
        skeleton = motion.skeleton
        arrays = {
            "root_pos_m": motion.root_pos_m,
            "local_quat": motion.local_quat,
            "fps": np.array(motion.fps),
            "names": np.array(skeleton.names),
            "parents": skeleton.parents,
            "offsets_m": skeleton.offsets_m,
            "tip_parents": skeleton.tip_parents,
            "tips_m": skeleton.tips_m,
        }
        if skeleton.roles is not None:
            arrays["roles"] = skeleton.role_numbers()
        if skeleton.names == CANONICAL_JOINTS:
            arrays["poses"] = rot.to_rotvec(motion.local_quat).reshape(motion.n_frames, -1)  # (T, 72)
            arrays["trans"] = motion.root_pos_m
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, array in arrays.items():
                with archive.open(zipfile.ZipInfo(f"{name}.npy", _EPOCH), "w", force_zip64=True) as file:
                    np.lib.format.write_array(file, array, allow_pickle=False)
            archive.comment = (DANCE_GENERATOR if self.is_dance else GENERATOR).encode()
