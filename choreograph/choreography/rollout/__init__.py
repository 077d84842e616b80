"""The rollout engine, in which a recurrent network dances a sequence of motifs (Rhythm is a Dancer)."""
