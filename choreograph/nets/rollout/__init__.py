"""The recurrent network that dances motifs (Rhythm is a Dancer, section 4).

- `config` — sizes, conditioning, loss weights and presets
- `model` — the LSTM, its conditioning, and the style layer
- `data` — motion to pose rows and back, and conditions of frames
- `training_data` — takes at several tempi to batches of sequences
- `losses` — poses, root, contacts, foot slide and the perceptual loss
- `train` — teacher-forced and self-fed frames in turns (auto-conditioning)
"""
