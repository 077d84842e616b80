"""The networks of a repertoire, a folder each; none of the `config` modules imports torch.

Networks

- `style` — music and motion to style vectors, and the beat count of the music
- `density` — music and motion to tempo-densities
- `words` — motion words to embeddings
- `counts` — motion to phases in beat and bar, which `features.bar_pointer` decodes to counts
- `rollout` — motifs and music to poses, frame by frame

In each: `config` (sizes and presets), `model`, `data` (takes to training batches), `train`, and where they
are long `losses`.

What they share

- `training` — the training loop with checkpoints, log and progress
- `stored` — networks to arrays and back, inference in batches
- `presets` — named configurations with fields changed
- `kinematics` — differentiable forward kinematics
"""
