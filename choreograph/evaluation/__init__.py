"""Measures dances against real dances and chance, by metrics and by people's ratings."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["metrics"])
