"""The graph engine: clips warped to the music, costs, and planners that find the best path (ChoreoGraph)."""
