"""The steps of AdamW against those of torch's class, and that its compiler is not imported."""

from __future__ import annotations

import subprocess
import sys

import pytest
import torch
from torch import nn

from choreograph.nets.adamw import AdamW


def module() -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(4, 5), nn.ReLU(), nn.Linear(5, 3), nn.Linear(3, 2))


def gradients(net: nn.Module, step: int) -> None:
    """Set gradients of a step. The last layer has none."""
    torch.manual_seed(step)
    nn.functional.mse_loss(net[:3](torch.randn(6, 4)), torch.randn(6, 3)).backward()


def weights(net: nn.Module) -> torch.Tensor:
    return torch.cat([parameter.detach().ravel() for parameter in net.parameters()])


@pytest.mark.parametrize("weight_decay", [0.0, 1e-2])
def test_steps_are_those_of_torch_to_the_bit_also_after_its_checkpoint(weight_decay):
    ours, theirs = module(), module()
    own = AdamW(ours.parameters(), weight_decay)
    other = torch.optim.AdamW(theirs.parameters(), lr=1.0, weight_decay=weight_decay)
    for step in range(8):
        rate = 1e-2 / (1 + step)
        other.param_groups[0]["lr"] = rate
        for net, optimizer in ((ours, own), (theirs, other)):
            optimizer.zero_grad()
            gradients(net, step)
        own.step(rate)
        other.step()
        assert torch.equal(weights(ours), weights(theirs))
        if step == 4:
            own = AdamW(ours.parameters(), weight_decay)
            own.load_state_dict(other.state_dict())
    assert not torch.equal(weights(ours), weights(module()))


def test_a_state_comes_back():
    net = module()
    optimizer = AdamW(net.parameters(), 0.1)
    gradients(net, 0)
    optimizer.step(1e-2)
    again = module()
    again.load_state_dict(net.state_dict())
    resumed = AdamW(again.parameters(), 0.1)
    resumed.load_state_dict(optimizer.state_dict())
    for one, its in ((net, optimizer), (again, resumed)):
        its.zero_grad()
        gradients(one, 1)
        its.step(1e-2)
    assert torch.equal(weights(net), weights(again))


@pytest.mark.parametrize("fault", ["parameters", "shape", "missing"])
def test_a_state_of_another_module_is_refused(fault):
    net = module()
    optimizer = AdamW(net.parameters(), 0.0)
    gradients(net, 0)
    optimizer.step(1e-3)
    stored = optimizer.state_dict()
    if fault == "parameters":
        stored = {**stored, "param_groups": [{"params": [0, 1]}]}
    elif fault == "shape":
        stored["state"][0]["exp_avg"] = torch.zeros(2)
    else:
        del stored["state"][1]["exp_avg_sq"]
    with pytest.raises((ValueError, KeyError)):
        AdamW(module().parameters(), 0.0).load_state_dict(stored)


def test_a_training_does_not_import_the_compiler_of_torch():
    code = (
        "import sys, torch\n"
        "from choreograph.nets.training import train\n"
        "net = torch.nn.Linear(2, 1)\n"
        "train(net, lambda rng, device: net(torch.ones(3, 2)).square().mean(), name='toy', n_steps=3,\n"
        "      learning_rate=1e-2, weight_decay=1e-2, seed=0, configuration={})\n"
        "assert 'torch._dynamo' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
