"""Prints a constraint for the lowest version of each dependency that pyproject.toml allows.

Not for torch: pip finds no old build for the CPU where it installs the others from.
"""

import re
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).resolve().parents[1] / "pyproject.toml").read_text())["project"]
for requirement in project["dependencies"]:
    name, _, lowest = requirement.partition(">=")
    if not re.fullmatch(r"[\d.]+", lowest):
        raise SystemExit(f"expected NAME>=VERSION, got {requirement}")
    if name != "torch":
        print(f"{name}=={lowest}")
