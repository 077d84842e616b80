"""From a song and constraints to a plan: song analysis, constraints, motifs, and three engines."""
