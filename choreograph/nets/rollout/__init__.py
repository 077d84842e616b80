"""The recurrent network that dances motifs (Rhythm is a Dancer, section 4).

- `config` — sizes, conditioning, loss weights and presets
- `model` — the LSTM, its conditioning, and the style layer
- `data` — motion to pose rows and back; takes to batches of sequences
- `losses` — poses, root, contacts, foot slide and the perceptual loss
- `train` — teacher-forced and self-fed frames in turns (auto-conditioning)
"""
