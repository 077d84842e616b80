"""Networks to arrays and back."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch
from torch import nn

from choreograph.core.errors import ParameterError
from choreograph.nets.stored import StoredNet


@dataclass(frozen=True)
class ToyConfig:
    widths: tuple[int, ...] = (3, 2)


class ToyNet(StoredNet):
    config_class = ToyConfig

    def __init__(self, config):
        super().__init__()
        self.config = config
        self.linear = nn.Linear(*config.widths)

    def double(self, rows):
        return self._in_batches(len(rows), lambda part: 2 * torch.from_numpy(rows[part]), 4)


def test_weights_and_configuration_come_back():
    net = ToyNet(ToyConfig((4, 5)))
    arrays, config = net.to_arrays()
    again = ToyNet.from_arrays(arrays, {"widths": list(config["widths"])})  # as JSON has it
    assert again.config == net.config
    assert torch.equal(again.linear.weight, net.linear.weight)
    assert not again.training


def test_unknown_fields_and_weights_that_do_not_fit_are_refused_in_one_line():
    arrays, config = ToyNet(ToyConfig()).to_arrays()
    with pytest.raises(ParameterError, match="fields of ToyConfig, got colour"):
        ToyNet.from_arrays(arrays, {**config, "colour": 1})
    with pytest.raises(ParameterError, match="other shapes") as caught:
        ToyNet.from_arrays(arrays, {"widths": (3, 7)})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("n_rows", [0, 1, 300])
def test_inference_in_batches_returns_every_row(n_rows):
    rows = np.random.default_rng(0).normal(size=(n_rows, 4)).astype(np.float32)
    np.testing.assert_array_equal(ToyNet(ToyConfig()).double(rows), 2 * rows)
