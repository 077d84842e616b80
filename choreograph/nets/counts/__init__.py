"""Counts read by networks: where in the beat and in the bar every frame is, and how sure that is.

Shared

- `trunk` — dilated convolutions that see many seconds at once
- `phases` — counts to phases, the likelihood that trains, network outputs to `PhaseCurves`
- `confidence` — from decoded counts to the probability that they are right

Motion

- `motion_config` — sizes and training lengths
- `motion_model` — body positions to curves of phase, and to counts
- `motion_data` — takes with counts to augmented batches
- `motion_train` — the training

Music

- `music_config` — sizes and training length
- `music_model` — log-mel to activations and curves of phase
- `music_augmentation`, `music_data` — songs with counts to batches, newly recorded
- `music_train`, `music_weights` — the training, and what ships
- `music_tracker` — beats of a song

`features.bar_pointer` decodes the curves.
"""
