"""A refiner keeps bones and feet, critics see what judges see, and takes are split as judges split them."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import choreograph as cg
from research import refined_takes, refiner, refiner_training
from research.real_from_real import Body
from research.real_or_built_in import windows_of


@pytest.fixture(scope="module")
def takes() -> list[Body]:
    repertoire = cg.starter_repertoire()
    return [
        (f"take-{index}", "waltz", "CMU", repertoire.body_pos_m(index)[:170].astype(np.float32))
        for index in range(4)
    ]


@pytest.fixture
def pos(takes) -> torch.Tensor:
    return torch.from_numpy(np.stack([take[3] for take in takes]))


@pytest.mark.parametrize("held", [True, False])
def test_bones_keep_their_length_and_held_feet_their_place(pos, held):
    torch.manual_seed(0)
    net = refiner.Refiner(16, held)
    with torch.no_grad():
        assert torch.allclose(net(pos, refiner.noise_like(pos)), pos, atol=3e-3)  # it begins with no change
        torch.nn.init.normal_(net.net.last.weight, 0, 0.03)
        moved = net(pos, refiner.noise_like(pos))
    lengths = [refiner.bones_of(p)[..., 1:, :].norm(dim=-1) for p in (pos, moved)]
    assert torch.allclose(*lengths, atol=1e-4)
    feet = (moved - pos)[..., list(refiner.FEET), :].norm(dim=-1)
    assert (moved - pos).norm(dim=-1).mean() > 0.005
    assert (feet.median() < 1e-4) == held


def test_critics_see_the_velocities_that_judges_see(takes, pos):
    judged = windows_of(takes).velocity[0]  # (63, 40), whose first frame is that of the take
    seen = refiner.velocities(pos[:1].double())[0].numpy()  # 9 frames at each end are lost
    assert np.allclose(seen[:, :31], judged[:, 9:], atol=1e-5)


def test_each_network_learns_a_step_and_refines_whole_takes(takes):
    setting = refiner.Setting("held", timing=1.0)
    networks = (
        refiner_training.Adversary(setting, takes, takes, 0, 8, 4, "cpu"),
        refiner_training.Denoiser(takes, 0, 8, 4, "cpu"),
        refiner_training.Diffusion(takes, 0, 8, 4, "cpu"),
    )
    for network in networks:
        before = [p.clone() for p in network.net.parameters()]
        network.step()
        assert any(not torch.equal(b, p) for b, p in zip(before, network.net.parameters(), strict=True))
        found = network.refined([take[3] for take in takes[:2]], seed=0)
        assert all(np.isfinite(after).all() for of_how in found.values() for after in of_how)
        assert [after.shape for after in found[network.hows[0]]] == [take[3].shape for take in takes[:2]]


def test_judges_of_unseen_takes_have_none_that_a_refiner_was_trained_on(takes):
    trained, tested = refined_takes.halves(takes)
    assert [take[0] for take in tested] == ["take-1", "take-3"]
    assert len(refined_takes.sides_of(takes, unseen=True).genre) == len(windows_of(tested).genre)
    assert len(refined_takes.sides_of(takes, unseen=False).genre) == len(windows_of(trained + tested).genre)
