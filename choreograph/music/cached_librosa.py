"""The only import of librosa, whose compiled kernels are kept by `kernel_cache`.

librosa compiles some kernels when their module is imported, and imports its modules when they are first used.
So all modules with kernels are imported here, except the beat tracker, which takes a second more.
"""

from __future__ import annotations

from types import ModuleType

from choreograph.core.kernel_cache import kernel_cache

with kernel_cache():
    import librosa
    import librosa.core.audio
    import librosa.core.constantq
    import librosa.core.notation
    import librosa.core.pitch
    import librosa.core.spectrum
    import librosa.feature.utils
    import librosa.filters
    import librosa.segment
    import librosa.sequence
    import librosa.util.matching
    import librosa.util.utils

__all__ = ["librosa", "librosa_beat"]


def librosa_beat() -> ModuleType:
    """librosa's beat tracker."""
    with kernel_cache():
        import librosa.beat
    return librosa.beat
