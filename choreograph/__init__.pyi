from .characters.character import GltfCharacter as GltfCharacter
from .characters.character import read_character as read_character
from .choreography.constraints import Ban as Ban
from .choreography.constraints import Keep as Keep
from .choreography.constraints import MotifPin as MotifPin
from .choreography.constraints import TakePin as TakePin
from .choreography.edits import Hold as Hold
from .choreography.edits import MoveJoin as MoveJoin
from .choreography.edits import Repeat as Repeat
from .choreography.edits import Swap as Swap
from .choreography.edits import Vary as Vary
from .choreography.graph.cost import Cost as Cost
from .choreography.graph.layers import Layer as Layer
from .core import __version__ as __version__
from .core.counts import Counts as Counts
from .core.errors import ChoreographError as ChoreographError
from .core.errors import FormatError as FormatError
from .core.errors import NoPathError as NoPathError
from .core.errors import ParameterError as ParameterError
from .core.errors import RepertoireError as RepertoireError
from .evaluation import metrics
from .evaluation.coverage import coverage as coverage
from .evaluation.dance_scores import evaluate as evaluate
from .evaluation.lint import lint as lint
from .evaluation.movement import movement as movement
from .formats.bvh import BvhOptions as BvhOptions
from .formats.register import load_motion as load_motion
from .formats.register import save_motion as save_motion
from .library.building.options import BuildOptions as BuildOptions
from .library.building.options import BuildResult as BuildResult
from .library.builtin import example_songs as example_songs
from .library.repertoire import Repertoire as Repertoire
from .library.repertoire import starter_repertoire as starter_repertoire
from .motion.motion import Credits as Credits
from .motion.motion import Motion as Motion
from .motion.motion import Take as Take
from .motion.skeleton import Skeleton as Skeleton
from .music.song import Song as Song
from .music.song import load_song as load_song
from .music.song_features import SongFeatures as SongFeatures
from .pipeline.building import build as build
from .pipeline.building import change_takes as change_takes
from .pipeline.counting import count_file as count_file
from .pipeline.dancing import Dance as Dance
from .pipeline.dancing import dance as dance
from .pipeline.editing import Alternative as Alternative
from .pipeline.editing import edit as edit
from .pipeline.rollout_stream import RolloutFrame as RolloutFrame
from .pipeline.rollout_stream import RolloutStream as RolloutStream
from .pipeline.scenes import Dancer as Dancer
from .pipeline.scenes import Scene as Scene
from .pipeline.scenes import render_scene_plan as render_scene_plan
from .pipeline.scenes import scene as scene
from .pipeline.session import Session as Session
from .pipeline.session import motifs_of as motifs_of
from .pipeline.session import signature_of as signature_of
from .pipeline.session import vary as vary
from .plan.plan import Plan as Plan
from .plan.scenes import ScenePlan as ScenePlan
from .render.rendering import render as render
from .settings import DanceConfig as DanceConfig

__all__ = [
    "Alternative",
    "Ban",
    "BuildOptions",
    "BuildResult",
    "BvhOptions",
    "ChoreographError",
    "Cost",
    "Counts",
    "Credits",
    "Dance",
    "DanceConfig",
    "Dancer",
    "FormatError",
    "GltfCharacter",
    "Hold",
    "Keep",
    "Layer",
    "MotifPin",
    "Motion",
    "MoveJoin",
    "NoPathError",
    "ParameterError",
    "Plan",
    "Repeat",
    "Repertoire",
    "RepertoireError",
    "RolloutFrame",
    "RolloutStream",
    "Scene",
    "ScenePlan",
    "Session",
    "Skeleton",
    "Song",
    "SongFeatures",
    "Swap",
    "Take",
    "TakePin",
    "Vary",
    "__version__",
    "build",
    "change_takes",
    "count_file",
    "coverage",
    "dance",
    "edit",
    "evaluate",
    "example_songs",
    "lint",
    "load_motion",
    "load_song",
    "metrics",
    "motifs_of",
    "movement",
    "read_character",
    "render",
    "render_scene_plan",
    "save_motion",
    "scene",
    "signature_of",
    "starter_repertoire",
    "vary",
]
