"""How large an input of each kind may be, as a file and once it is decompressed.

A file from an untrusted source must not take memory out of proportion to its size. Readers refuse a larger
one before they read it, and stop where it unpacks to more. Songs are decoded block by block, and repertoires
are read row by row, so that their sizes have no limit here.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Budget:
    """The limits of one kind of input."""

    file_bytes: int
    unpacked_bytes: int  # of what is in memory at once


_MB = 1 << 20
BUDGETS = {
    "text": Budget(16 * _MB, 16 * _MB),  # a plan, a list or another file that a person may read
    "table": Budget(4 * _MB, 4 * _MB),  # each row takes a hundred times its bytes
    "bvh": Budget(512 * _MB, 512 * _MB),
    "c3d": Budget(256 * _MB, 256 * _MB),
    "vmd": Budget(256 * _MB, 256 * _MB),
    "npy": Budget(256 * _MB, 256 * _MB),
    "npz": Budget(1024 * _MB, 1024 * _MB),
    "pkl": Budget(64 * _MB, 64 * _MB),
    "gltf": Budget(1024 * _MB, 1024 * _MB),  # with its buffers and images
    "fbx": Budget(1024 * _MB, 1024 * _MB),
    "project": Budget(190_000_000 // 3, 190_000_000),  # each byte of the file is counted three times
}
