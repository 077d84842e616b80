"""Songs: decoding, features, beats, bars, sections, and synthesis of songs with known counts."""
