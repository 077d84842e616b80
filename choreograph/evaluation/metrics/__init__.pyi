# ruff: noqa: I001 - in the order of the reference, under its headings

# Music and dance
from . import beat as beat
from . import counts as counts
from . import motion_beat_detectors as motion_beat_detectors
from . import count_phase as count_phase
from . import energy_response as energy_response
from . import labels as labels
from . import structure as structure
from . import phrase_returns as phrase_returns
from . import transitions as transitions
from . import requests as requests

# Scenes
from . import scene as scene

# Realism
from . import fid as fid
from . import frechet as frechet

# Physics
from . import physical as physical
from . import endings as endings
from . import front as front
from . import contact_scores as contact_scores
