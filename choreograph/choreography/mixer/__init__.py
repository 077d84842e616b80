"""The mixer engine: motion words of takes that dance a sequence of motifs (Rhythm is a Dancer)."""
