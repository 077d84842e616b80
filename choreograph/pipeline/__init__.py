"""The stages in order: a song and a repertoire to a dance, takes to a repertoire."""
