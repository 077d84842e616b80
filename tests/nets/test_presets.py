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


def test_few_words_are_trained_in_fewer_steps():
    steps = [word_config("small", n_words=n_words).steps for n_words in (20, 500, 1000, 10**6)]
    assert steps == [300, 400, 800, 800]
    assert word_config("tiny", n_words=20).steps == word_config("tiny").steps
    assert word_config("small", n_words=20, steps=7).steps == 7
    begun = {word_config("small", n_words=n_words, pretrained=True).steps for n_words in (20, 10**6)}
    assert begun == {150} and word_config("tiny", pretrained=True).steps == word_config("tiny").steps
