"""The repertoire: its file, motion words and motifs, building one, and the built-in one."""
