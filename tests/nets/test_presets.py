"""Configurations: presets, unknown names, and that they do not need torch."""

import subprocess
import sys

import pytest

from choreograph.core.errors import ParameterError
from choreograph.nets.configs import density_config, rollout_config, style_config, word_config


@pytest.mark.parametrize("config", [style_config, density_config, word_config, rollout_config])
def test_fields_are_changed_by_name_and_unknown_names_are_refused(config):
    assert config("tiny", steps=7).steps == 7
    with pytest.raises(ParameterError, match="paper, small, tiny, got 'huge'"):
        config("huge")
    with pytest.raises(ParameterError, match=r"fields of \w+Config, got colour"):
        config("tiny", colour=1)


def test_configurations_do_not_import_torch():
    modules = "choreograph.nets.configs"
    code = f"import sys, {modules}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
