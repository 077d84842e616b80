"""Styles in five, six and seven, for benchmark songs. Nothing is trained or tuned on them.

Beats of 5/4 are quarters. Beats of 6/8 and 7/8 are eighths. The groups of a bar are in the name of the style.
"""

from __future__ import annotations

from content.songs.synthesis.style import Lane, Part, SongStyle

FIVE_JAZZ = SongStyle(
    name="jazz in 3+2",
    bpm=(150.0, 180.0),
    beats_per_bar=5,
    swing=0.8,
    lanes=(
        Lane("ride", ("x...x.o.x...x...x.o.", "x...x.o.x.o.x...x.o."), db=-8.0, pan=0.3),
        Lane("soft kick", ("X...........x.......",), enters=0.3, db=-6.0, send=0.05),
        Lane("pedal", ("....x...x.......x...",), enters=0.4, db=-12.0, pan=0.2),
        Lane("brush", ("........o.......o...",), enters=0.6, db=-13.0),
    ),
    parts=(
        Part("bass", ("upright bass",), ("1-----5-....1---5---", "1-----5-....8---5---"), db=-6.0, low=31),
        Part("chords", ("piano",), ("x--.x---x.--x---x---", "x--.x--.x-..x---x-.."), 0.2, db=-14.0, pan=-0.2),
        Part(
            "melody",
            ("clarinet", "vibraphone"),
            ("x-x-x-x---..x---x-..", "x---x-x-x-x-x-------"),
            0.5,
            db=-13.0,
            low=60,
            high=82,
        ),
    ),
    progressions=("Am7 Dm7 Am7 E7", "Am7/E7 Am7/E7 Fmaj7/G7 Am7/E7", "Dm7 G7 Cmaj7 E7"),
    scales=("minor", "dorian"),
    fills=(("brush", "x.x.x.x.x.x.x.x.x.xx"), ("snare", "........x.x.x.x.x.x.")),
    ending=("soft kick", "ride"),
    crash=None,
)

FIVE_ROCK = SongStyle(
    name="rock in 2+3",
    bpm=(108.0, 140.0),
    beats_per_bar=5,
    lanes=(
        Lane("kick", ("X.......X.x.........", "X.....x.X...........", "X...x...X.........x."), 0.3, db=-5.0),
        Lane("snare", ("....X...........X...", "....X.......x...X..."), 0.3, db=-7.0),
        Lane("hat", ("x.o.x.o.x.o.x.o.x.o.", "x...x...x...x...x..."), db=-11.0, pan=0.2),
    ),
    parts=(
        Part(
            "bass", ("round bass", "analog bass"), ("1-..1-..1-..1-..n-..", "1---1---1-5-1---5---"), db=-7.0
        ),
        Part("chords", ("muted guitar", "clav"), ("x...x...x.x.x...x...",), 0.3, db=-17.0, pan=-0.4),
        Part("chords", ("organ", "warm pad"), ("x-------x-----------",), 0.5, db=-18.0, width=0.6),
        Part(
            "melody",
            ("saw lead", "flute"),
            ("x---x-x-x---x-x-x---", "..x-x---x-----x-x---"),
            0.6,
            db=-14.0,
            low=60,
        ),
    ),
    progressions=("Am F C G", "C G Am F", "Dm Bb F C"),
    scales=("minor pentatonic", "major pentatonic"),
    fills=(("snare", "............x.x.xxxx"), ("low tom", "........x.x.x.x.x.x.")),
)

SIX_BALLAD = SongStyle(
    name="ballad in 3+3",
    bpm=(150.0, 195.0),
    beats_per_bar=6,
    room_s=2.0,
    lanes=(
        Lane("kick", ("X.......................", "X...................x..."), 0.3, db=-6.0),
        Lane("fat snare", ("............X...........",), 0.3, db=-8.0, send=0.2),
        Lane("hat", ("x...o...o...x...o...o...",), 0.2, db=-13.0, pan=0.2),
        Lane("shaker", ("o...o...o...o...o...o...",), leaves=0.6, db=-14.0, pan=-0.3),
    ),
    parts=(
        Part("bass", ("round bass",), ("1-----------....1---5---", "1-------------------n---"), db=-7.0),
        Part(
            "chords", ("nylon guitar", "harp", "felt piano"), ("1...2...3...4...3...2...",), db=-13.0, pan=0.2
        ),
        Part("chords", ("organ", "strings"), ("x-----------------------",), 0.6, db=-20.0, width=0.8),
        Part(
            "melody",
            ("violin", "flute"),
            ("x-------x---x-----------", "x---x---x---x-------x---"),
            0.4,
            db=-13.0,
            low=60,
            high=82,
        ),
    ),
    progressions=("C Am F G", "C/Am F/G C/Am F/G", "Am F C G", "F C/Am Dm G"),
    scales=("major",),
    fills=(("fat snare", "............x...x.x.x.x."), ("low tom", "............x...x...x...")),
)

SIX_JIG = SongStyle(
    name="jig in 3+3",
    bpm=(200.0, 232.0),
    beats_per_bar=6,
    lanes=(
        Lane("tumba", ("X.......o...x.......o...", "X...........x...o...o..."), 0.2, db=-7.0),
        Lane("tambourine", ("........x...........x...",), 0.5, db=-15.0, pan=0.3),
        Lane("clap", ("............x...........",), 0.8, db=-13.0),
    ),
    parts=(
        Part(
            "bass", ("pizzicato", "cello"), ("1-------....5-------....", "1-------....1-------...."), db=-8.0
        ),
        Part("chords", ("accordion", "muted guitar"), ("........x-..........x-..",), 0.2, db=-15.0, pan=-0.2),
        Part(
            "melody",
            ("violin", "flute", "accordion"),
            ("x-..x-..x-..x-..x-..x-..", "x---....x-..x---....x-..", "x-..x-..x-..x---....x-.."),
            0.3,
            db=-12.0,
            low=62,
            high=86,
        ),
    ),
    progressions=("C C G C", "Am G Am G", "C F C G", "C/F C/G C/F G/C"),
    scales=("major", "dorian"),
    fills=(("tumba", "x...x...x...x...x...x..."), ("tambourine", "x...x...x...x.x.x.x.x.x.")),
    crash=None,
)

SEVEN_AKSAK = SongStyle(
    name="aksak in 2+2+3",
    bpm=(195.0, 232.0),
    beats_per_bar=7,
    lanes=(
        Lane("tumba", ("X.......x.......x.......o...", "X.......x.......x..........."), 0.2, db=-6.0),
        Lane("tambourine", ("....x.......x.......x...x...",), 0.3, db=-13.0, pan=0.3),
        Lane("rim", ("............x...........o...",), 0.6, db=-14.0, pan=-0.2),
    ),
    parts=(
        Part(
            "bass",
            ("upright bass",),
            ("1-------5-------1-------....", "1-------1-------5-------n---"),
            db=-7.0,
        ),
        Part(
            "chords",
            ("accordion", "nylon guitar"),
            ("....x-......x-......x-..x-..",),
            0.2,
            db=-15.0,
            pan=-0.2,
        ),
        Part(
            "melody",
            ("clarinet", "violin"),
            ("x---x---x---x---x---x---x---", "x-------x-------x---x---x---"),
            0.3,
            db=-12.0,
            low=60,
            high=84,
        ),
    ),
    progressions=("Am Dm E7 Am", "Am G Am G", "Dm Am E7 Am"),
    scales=("harmonic minor", "minor"),
    fills=(("tumba", "x...x...x...x...x...x...x..."), ("rim", "................x...x...x.x.")),
    crash=None,
)

SEVEN_ROCK = SongStyle(
    name="rock in 4+3",
    bpm=(120.0, 165.0),
    beats_per_bar=7,
    lanes=(
        Lane("kick", ("X.......X.......X...........", "X.....x.X.......X.......x..."), 0.3, db=-5.0),
        Lane("snare", ("....X.......X.......X.......", "....X.......X.......X.....x."), 0.3, db=-7.0),
        Lane("hat", ("x.o.x.o.x.o.x.o.x.o.x.o.x.o.",), db=-11.0, pan=0.2),
    ),
    parts=(
        Part("bass", ("slap bass", "analog bass"), ("1-..1-..5-..1-..1-..5-..n-..",), db=-7.0),
        Part(
            "chords", ("electric piano", "stab"), ("x---....x-..x-..x---....x-..",), 0.3, db=-15.0, pan=-0.3
        ),
        Part("chords", ("strings",), ("x---------------x-----------",), 0.6, db=-20.0, width=0.8),
        Part(
            "melody",
            ("square lead", "brass"),
            ("x---x-x-x---x---x-x-x---x---",),
            0.6,
            db=-14.0,
            low=60,
            high=84,
        ),
    ),
    progressions=("Am F C G", "Em C G D", "Dm Dm Bb C"),
    scales=("minor pentatonic", "dorian"),
    fills=(("snare", "................x.x.x.x.xxxx"), ("low tom", "................x.x.x.x.x.x.")),
)

METRE_STYLES = {
    style.name: style for style in (FIVE_JAZZ, FIVE_ROCK, SIX_BALLAD, SIX_JIG, SEVEN_AKSAK, SEVEN_ROCK)
}
