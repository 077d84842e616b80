"""The rollout engine: a recurrent network that dances a sequence of motifs (Rhythm is a Dancer)."""
