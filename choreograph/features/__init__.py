"""Features of music and of motion.

Music
mel            log-mel spectrogram at 60 fps
onsets         onset envelopes of three bands, and their autocorrelation
rhythm         tempo, metre and patterns of beat and bar, twice a second, by the counts of a song
frame_rhythm   four rhythmic features per frame at 30 fps (Rhythm is a Dancer, Table 2)
spectral       87 spectral features per beat interval (Rhythm is a Dancer, Table 2)
word_audio     audio input of the rollout network: rhythm per frame, spectrum per motion word
loudness       RMS normalisation
music_beats    beat trackers behind one interface
tempo_path     beat tracking with a varying tempo, the default tracker
beat_evidence  accents, changes and repeats at every beat
bars           numbers in the bar and metre of beats
music_changes  where the tempo or the metre changes for good
metrical_level half or double of the tracked tempo, by what takes are danced at
beat_files     beats and their numbers from a text file
energy         how loud each second is among the song's seconds
sections       section boundaries and labels of a song
song_features  `SongFeatures`: what the engines plan from

Motion
motion_beats   local minima of mean joint speed
contacts       foot contact confidence

Both
bar_pointer    curves of beat and bar phase to counts
density        analytic tempo-density: a bump on every beat
"""
