"""Plans of dances and scenes: their entries, and the runs and joins that they are played with."""
