"""From takes and their songs to a repertoire file."""
