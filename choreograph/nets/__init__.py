"""Networks of style, tempo-density, words, counts and rollout: models, data and training."""
