"""Audio files in, mono samples at one rate out.

song     `Song`, `load_song`: mono at 22.05 kHz, checked, with notes
decode   any audio file as a sample rate and blocks of floats, through soundfile or PyAV
"""
