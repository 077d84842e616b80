"""The options of `choreograph dance`, in the groups that its `--help` shows.

Settings have no default here: the pipeline must know which were given, and refuses those that the chosen
engine does not use.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click
from click_option_group import optgroup

from choreograph.cli.characters import NAMINGS, RESTS, UNITS
from choreograph.cli.present import Seconds

_FILE = click.Path(path_type=Path)

_OUTPUT = (
    optgroup.option(
        "-o", "--output", multiple=True, type=_FILE,
        help="File to write: .bvh or .npz (motion), .glb, .fbx, .usda, .usdc (a dancing body), .vrma (for "
        "VRM avatars), .html (page to watch), .mp4 (video), .png (poses on the beats), .json (the plan). "
        "Repeat for more. Default: SONG.bvh and SONG.html here. {song} in it stands for the song's name.",
    ),
    optgroup.option(
        "--character", type=_FILE,
        help="Character (.glb, .gltf, .vrm, .fbx) for the .html, .glb or .fbx. Default: a mannequin.",
    ),
    optgroup.option(
        "--map", "map_path", type=_FILE, help="Which bone of it is which, as --save-map writes it (.json)."
    ),
    optgroup.option("--save-map", type=_FILE, help="Write which bones were found (.json), to be edited."),
    optgroup.option(
        "--names", "naming", type=click.Choice(NAMINGS), help="Joint names of the .bvh (smpl)."
    ),
    optgroup.option("--units", type=click.Choice(tuple(UNITS)), help="Units of the .bvh (cm)."),
    optgroup.option("--rest", type=click.Choice(RESTS), help="A standing rest pose in the .bvh: T or A."),
    optgroup.option("--in-place", is_flag=True, help="The hips stay in one place, in the .bvh."),
    optgroup.option(
        "--loop", is_flag=True, help="Motion files end where they begin, on a bar: to be played again."
    ),
    optgroup.option(
        "--click", "with_clicks", is_flag=True, help="Click on the counts in the video, higher on count 1."
    ),
    optgroup.option(
        "--force", is_flag=True,
        help="Replace files of the default names, and of those with {song}, that are no dances made here.",
    ),
    optgroup.option("--open", "opened", is_flag=True, help="Open the page in the browser."),
    optgroup.option("--fps", type=float, help="Frames per second of the dance (60)."),
    optgroup.option("--variations", type=int, metavar="N", help="N different dances: NAME-1.bvh, …"),
    optgroup.option("--json", "as_json", is_flag=True, help="Print what was made as JSON."),
    optgroup.option(
        "--progress-lines", "as_lines", is_flag=True,
        help="Progress as lines on stderr, STAGE DONE/TOTAL, for a program that shows it.",
    ),
    optgroup.option("-q", "--quiet", is_flag=True, help="No progress, no notes, no summary."),
)  # fmt: skip

_SOURCES = (
    optgroup.option("--db", type=_FILE, help="Repertoire to dance with. Default: the built-in one."),
    optgroup.option("--start", type=Seconds(), help="Second of the song to start at, or 1:15.5 (0)."),
    optgroup.option("--duration", type=Seconds(), help="Seconds to dance. Default: to the end of the song."),
    optgroup.option(
        "--beats",
        metavar="network|tempo-path|librosa|beat-this|FILE",
        help="Beat tracker (network), or a text file of the song's beats: a time in seconds and, if you "
        "know it, the number in the bar on every line, such as 12.34 1.",
    ),
)

_CONSTRAINTS = (
    optgroup.option(
        "--genre", help="Follow this genre of the repertoire. Default: the one nearest to the song."
    ),
    optgroup.option(
        "--signature", type=_FILE,
        help="Dance each motif as often as this file says. `choreograph inspect --signature` writes one.",
    ),
    optgroup.option(
        "--motifs", "motif_file", type=_FILE,
        help="Dance these motifs. A plan, or JSON: a list of numbers or of {\"at_s\": …, \"motif\": …}.",
    ),
    optgroup.option(
        "--recreate", metavar="TAKE",
        help="Dance the motifs of this take, or of a motion file with its song beside it.",
    ),
    optgroup.option(
        "--pin", multiple=True, metavar="SECOND=motif:N|FROM-TO=take:NAME",
        help="Dance this motif or take at this time of the dance. Repeat for more.",
    ),
    optgroup.option(
        "--ban", multiple=True, metavar="take:NAME|genre:NAME|motif:N",
        help="Never dance this. Repeat for more.",
    ),
    optgroup.option(
        "--keep", multiple=True, metavar="FROM-TO",
        help="Keep these seconds of the dance of --existing, and dance the rest anew. Repeat for more.",
    ),
    optgroup.option(
        "--existing", type=_FILE,
        help="The dance to keep parts of: a .bvh, a .npz or a plan (.json). Beside --plan, that of which the "
        "plan keeps parts, if it is not in its folder.",
    ),
    optgroup.option(
        "--strict", is_flag=True,
        help="Fail, and write nothing, if a pin, ban or given motif is not danced; without, a note says so.",
    ),
    optgroup.option(
        "--plan", "plan_path", type=_FILE,
        help="Render this plan, edited or not. SONG is then only the sound of a page or video.",
    ),
)  # fmt: skip

_ENGINE = (
    optgroup.option(
        "--engine", metavar="graph|mixer|rollout",
        help="graph (default): seconds of takes. mixer: motion words of takes. rollout: a network's motion.",
    ),
    optgroup.option("--seed", type=int, help="Another seed gives another dance (0)."),
    optgroup.option("--config", type=_FILE, help="TOML file of settings."),
    optgroup.option(
        "--published", is_flag=True,
        help="ChoreoGraph as published, with a repertoire of `build-db --published`; other settings change "
        "it. Not with --engine mixer or rollout.",
    ),
)  # fmt: skip

_GRAPH_AND_MIXER = (
    optgroup.option(
        "--planner", metavar="exact|greedy|motion-graph",
        help="exact (default) looks at the whole song, greedy at one second or word at a time. "
        "motion-graph: graph engine only.",
    ),
    optgroup.option("--blending", metavar="inertial|linear", help="Kind of transition (inertial)."),
)  # fmt: skip

_GRAPH = (
    optgroup.option(
        "--transitions", metavar="beats|seconds",
        help="Transitions where they keep the beat best (beats, the default), or on whole seconds.",
    ),
    optgroup.option("--candidates", type=int, help="Clips to warp for each second (512)."),
    optgroup.option(
        "--selection", metavar="genre|style|random",
        help="Which clips: at random, at least half of the music's genre (default); nearest in style; any.",
    ),
    optgroup.option(
        "--warping", metavar="counts|dtw|none",
        help="Lay counts on beats (counts, the default; dtw where they are not known), warp clips by "
        "tempo-density (dtw), or not at all.",
    ),
    optgroup.option(
        "--density", metavar="repertoire|learned",
        help="What dtw aligns: the tempo-density of the repertoire (default), or only a learned one.",
    ),
    optgroup.option(
        "--time-maps", metavar="smooth|raw", help="Smooth the path of dtw (default), or play it as it is."
    ),
    optgroup.option("--lock-feet/--no-lock-feet", default=None, help="Lock feet that touch the ground."),
    optgroup.option(
        "--hold-ends/--no-hold-ends", default=None,
        help="Hold a pose before the song's first count, and one after its last.",
    ),
    optgroup.option(
        "--keep-on-stage/--no-keep-on-stage", default=None, help="Turn a little where dances walk away."
    ),
    optgroup.option(
        "--weight", multiple=True, metavar="COST=NUMBER",
        help="Weight of a cost: style, completeness, transition, … 0 leaves it out. Repeat for more.",
    ),
)  # fmt: skip

_MIXER_AND_ROLLOUT = (
    optgroup.option(
        "--motif-draw", metavar="missing|absolute",
        help="Draw motifs that the dance lacks (missing, the default), or by the absolute difference from "
        "the signature, as published.",
    ),
)  # fmt: skip

_ROLLOUT = (
    optgroup.option("--style-song", type=_FILE, help="Move in the style of this other song."),
    optgroup.option(
        "--style-strength", type=float,
        help="How much the song's style changes the motion (1.5; published: 40, with hamming).",
    ),
    optgroup.option(
        "--style-window", metavar="smooth|hamming",
        help="Smooth the style from word to word (default), or fade it in each, as published.",
    ),
)  # fmt: skip

_GROUPS = (
    ("Output", _OUTPUT),
    ("Song and repertoire", _SOURCES),
    ("What is danced", _CONSTRAINTS),
    ("Engine", _ENGINE),
    ("Graph and mixer engines", _GRAPH_AND_MIXER),
    ("Graph engine", _GRAPH),
    ("Mixer and rollout engines", _MIXER_AND_ROLLOUT),
    ("Rollout engine", _ROLLOUT),
)


def dance_options(command: Callable) -> Callable:
    """Add the options, group by group."""
    for name, options in reversed(_GROUPS):
        for option in reversed(options):
            command = option(command)
        command = optgroup.group(name)(command)
    return command
