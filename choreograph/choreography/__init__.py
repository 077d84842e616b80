"""Makes a plan from a song and constraints: song analysis, constraints, motifs, and three engines."""
