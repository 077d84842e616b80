"""What the user asked to be danced, kept or left out.

- `Constraints`, `MotifPin`, `TakePin`, `Ban`, `Keep` — as the user says it (`spec`)
- `parse` — from the command line's text and from files
- `resolve` — held against a repertoire and a song: slots of the dance's words
- `kept` — the dance of which stretches are kept, held against the song
- `likely_genre` — the genre of the repertoire that a song is nearest to
"""

from choreograph.constraints.spec import Ban, Constraints, Keep, MotifPin, TakePin, make_constraints

__all__ = ["Ban", "Constraints", "Keep", "MotifPin", "TakePin", "make_constraints"]
