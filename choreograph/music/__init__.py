"""Songs: decoding, features, beats, bars and sections; `synthesis` composes songs whose counts are known."""
