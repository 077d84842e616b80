"""A small composer and synthesiser of dance songs whose beats, bars and sections are known exactly."""
