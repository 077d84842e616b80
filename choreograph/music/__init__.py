"""Songs: decoding, features, beats, bars and sections."""
