"""The stages in order, from a song and a repertoire to a dance, and from takes to a repertoire."""
