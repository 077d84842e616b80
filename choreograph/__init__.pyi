from . import metrics as metrics
from ._version import __version__ as __version__
from .audio.song import Song as Song
from .audio.song import load_song as load_song
from .build_pipeline import build as build
from .building import BuildOptions as BuildOptions
from .building import BuildResult as BuildResult
from .characters import GltfCharacter as GltfCharacter
from .characters import read_character as read_character
from .config import DanceConfig as DanceConfig
from .constraints import Ban as Ban
from .constraints import Keep as Keep
from .constraints import MotifPin as MotifPin
from .constraints import TakePin as TakePin
from .errors import ChoreographError as ChoreographError
from .errors import FormatError as FormatError
from .errors import NoPathError as NoPathError
from .errors import ParameterError as ParameterError
from .errors import RepertoireError as RepertoireError
from .exporters import BvhOptions as BvhOptions
from .features.song_features import SongFeatures as SongFeatures
from .graph import Cost as Cost
from .graph import Layer as Layer
from .motion.motion import Motion as Motion
from .motion.skeleton import Skeleton as Skeleton
from .pipeline import Dance as Dance
from .pipeline import dance as dance
from .pipeline import render as render
from .pipeline import vary as vary
from .pipeline.recreation import motifs_of as motifs_of
from .pipeline.recreation import signature_of as signature_of
from .pipeline.rollout_stream import RolloutFrame as RolloutFrame
from .pipeline.rollout_stream import RolloutStream as RolloutStream
from .plan import Plan as Plan
from .repertoire import Repertoire as Repertoire
from .starter import example_songs as example_songs
from .starter import starter_repertoire as starter_repertoire
from .takes import Credits as Credits
from .takes import Take as Take

__all__ = [
    "Ban",
    "BuildOptions",
    "BuildResult",
    "BvhOptions",
    "ChoreographError",
    "Cost",
    "Credits",
    "Dance",
    "DanceConfig",
    "FormatError",
    "GltfCharacter",
    "Keep",
    "Layer",
    "MotifPin",
    "Motion",
    "NoPathError",
    "ParameterError",
    "Plan",
    "Repertoire",
    "RepertoireError",
    "RolloutFrame",
    "RolloutStream",
    "Skeleton",
    "Song",
    "SongFeatures",
    "Take",
    "TakePin",
    "__version__",
    "build",
    "dance",
    "example_songs",
    "load_song",
    "metrics",
    "motifs_of",
    "read_character",
    "render",
    "signature_of",
    "starter_repertoire",
    "vary",
]
