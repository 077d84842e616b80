"""The mixer engine, which dances a sequence of motifs with motion words of takes (Rhythm is a Dancer)."""
