"""Style embeddings of music and motion, and the beat-count head (ChoreoGraph, section 3.1).

- `config` — sizes, losses and presets; the dimension of style vectors
- `model` — both embeddings and the head
- `data` — takes to balanced, augmented batches
- `losses` — equation 1, and the contrastive loss
- `train` — the training of all three together
"""
