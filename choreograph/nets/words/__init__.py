"""Embeddings of motion words (Rhythm is a Dancer, section 3.3).

- `config` — sizes and presets; the dimension of embeddings
- `model` — the network
- `data` — takes to words and their augmented copies
- `train` — the loss and the training
"""
