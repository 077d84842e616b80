"""Configurations: presets, unknown names, and that they do not need torch."""

import subprocess
import sys

import pytest

from choreograph.errors import ParameterError
from choreograph.nets.density.config import density_config
from choreograph.nets.rollout.config import rollout_config
from choreograph.nets.style.config import style_config
from choreograph.nets.words.config import word_config


@pytest.mark.parametrize("config", [style_config, density_config, word_config, rollout_config])
def test_fields_are_changed_by_name_and_unknown_names_are_refused(config):
    assert config("tiny", steps=7).steps == 7
    with pytest.raises(ParameterError, match="paper, small, tiny, got 'huge'"):
        config("huge")
    with pytest.raises(ParameterError, match=r"fields of \w+Config, got colour"):
        config("tiny", colour=1)


def test_configurations_do_not_import_torch():
    modules = ", ".join(
        f"choreograph.nets.{name}.config" for name in ("style", "density", "words", "rollout")
    )
    code = f"import sys, {modules}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
