"""Prints a constraint for the lowest version of each dependency that pyproject.toml allows.

Where pip installs from PyPI, the old torch is a build for CUDA: 3 GB.
"""

import re
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).resolve().parents[1] / "pyproject.toml").read_text())["project"]
for requirement in project["dependencies"]:
    name, _, lowest = requirement.partition(">=")
    if not re.fullmatch(r"[\d.]+", lowest):
        raise SystemExit(f"expected NAME>=VERSION, got {requirement}")
    print(f"{name}=={lowest}")
