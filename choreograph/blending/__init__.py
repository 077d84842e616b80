"""From a plan to one continuous motion.

- `runs` — which take is played from when to when, without a transition
- `sampled_runs` — a run at the dance's frame rate, aligned with the run before it
- `transitions` — crossfade and inertialization from one run to the next
- `transition_search` — when each transition happens, and how long it takes
- `assembly` — all runs as one motion
- `foot_locking` — feet in contact stay where they are
- `stage` — the dance stays near the middle of the stage
- `rendering` — a plan to its motion: all of the above in order
"""
