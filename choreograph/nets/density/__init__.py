"""Tempo-densities of motion and music (ChoreoGraph, section 3.2).

- `config` — sizes, losses and presets
- `model` — the estimators of motion and music, and the decoder that only training needs
- `data` — random time maps, warped clips, and pairs of music and target density
- `losses` — equation 2, equivariance and location
- `train` — the training of motion's estimator, then of music's
"""
