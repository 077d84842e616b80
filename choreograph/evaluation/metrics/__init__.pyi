# ruff: noqa: I001 - in the order of the reference, under its headings

# Music and dance
from . import beat as beat
from . import counts as counts
from . import energy_response as energy_response
from . import labels as labels
from . import structure as structure
from . import transitions as transitions

# Scenes
from . import scene as scene

# Realism
from . import fid as fid
from . import frechet as frechet

# Physics
from . import physical as physical
from . import front as front
