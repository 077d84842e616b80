"""The training loop: exact resumption, interruption, refusals, log."""

import json
import os
import pickle
import signal
import zipfile

import numpy as np
import pytest
import torch
from torch import nn

from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.nets import training
from choreograph.nets.training import TrainingContext, load_pretrained, select_device, steps_of_epochs, train


def _module():
    torch.manual_seed(3)
    return nn.Sequential(nn.Linear(4, 8), nn.BatchNorm1d(8), nn.ReLU(), nn.Dropout(0.5), nn.Linear(8, 1))


def _run(
    module, folder=None, *, resume=False, report=lambda p: None, steps=60, seed=0, width=8, stop=None,
    content=None, notes=None,
):  # fmt: skip
    calls = []
    note = (lambda note: None) if notes is None else notes.append

    def loss(rng, device):
        calls.append(1)
        if len(calls) == stop:
            os.kill(os.getpid(), signal.SIGINT)  # Ctrl-C in the middle of a step
        x = torch.from_numpy(rng.normal(size=(16, 4)).astype(np.float32)).to(device)
        return ((module(x)[:, 0] - x.sum(dim=1)) ** 2).mean()

    return train(
        module, loss, name="toy", n_steps=steps, learning_rate=1e-2, weight_decay=0.01, seed=seed,
        configuration={"width": width},
        context=TrainingContext(folder, resume, "cpu", "float32", report, content or {}, note),
    )  # fmt: skip


def _equal(a, b):
    return all(
        torch.equal(x, y) for x, y in zip(a.state_dict().values(), b.state_dict().values(), strict=True)
    )


@pytest.mark.parametrize("stop", [1, 17, 59])
def test_interrupted_and_resumed_equals_uninterrupted_bit_for_bit(tmp_path, stop):
    uninterrupted, interrupted = _module(), _module()
    _run(uninterrupted)
    with pytest.raises(KeyboardInterrupt):
        _run(interrupted, tmp_path, stop=stop)
    assert torch.load(tmp_path / "toy.pt", weights_only=True)["step"] == stop
    resumed = _module()
    for value in resumed.parameters():
        value.data.zero_()  # only the checkpoint can restore it
    _run(resumed, tmp_path, resume=True)
    assert _equal(uninterrupted, resumed)
    assert {path.name for path in tmp_path.iterdir()} == {"toy.pt", "toy.jsonl"}


def test_training_lowers_the_loss_and_leaves_other_generators_alone():
    torch.manual_seed(11)
    expected = torch.rand(3)
    torch.manual_seed(11)
    seen = []
    module = _module()
    torch.manual_seed(11)
    _run(module, report=seen.append, steps=300)
    assert torch.equal(torch.rand(3), expected)
    assert seen[-1].loss < 0.5 * seen[0].loss
    assert seen[-1].step == seen[-1].n_steps == 300 and seen[-1].seconds_left == 0
    assert not module.training


def test_a_constant_rate_stays_and_a_cosine_one_falls():
    moved = {}
    for schedule in ("constant", "cosine"):
        line = nn.Linear(1, 1, bias=False)
        start = line.weight.item()
        train(
            line, lambda rng, device, line=line: line.weight.sum(), name="line", n_steps=20,
            learning_rate=1e-2, weight_decay=0.0, seed=0, configuration={}, schedule=schedule,
            context=TrainingContext(device="cpu"),
        )  # fmt: skip
        moved[schedule] = start - line.weight.item()
    assert moved["constant"] == pytest.approx(20 * 1e-2, rel=1e-4)  # Adam's step on a constant gradient
    assert moved["cosine"] < 0.7 * moved["constant"]


def test_an_epoch_sees_as_many_examples_as_there_are():
    assert [steps_of_epochs(10, n, 16) for n in (3, 16, 16.5, 160)] == [10, 10, 20, 100]


def test_another_seed_gives_other_weights():
    a, b = _module(), _module()
    _run(a, seed=0)
    _run(b, seed=1)
    assert not _equal(a, b)


def test_the_rows_of_another_process_have_other_dropout(monkeypatch):
    seen = []
    for index in (0, 1):
        monkeypatch.setattr(training, "process_index", lambda index=index: index)
        _run(_module(), report=seen.append, steps=1)
    assert seen[0].loss != pytest.approx(seen[1].loss, rel=1e-3)


def test_log_is_json_lines_and_resumption_continues_it(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        _run(_module(), tmp_path, stop=20)
    _run(_module(), tmp_path, resume=True)
    lines = [json.loads(line) for line in (tmp_path / "toy.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == list(range(1, 61))
    assert all(np.isfinite(line["loss"]) and line["name"] == "toy" for line in lines)


def test_complete_checkpoint_is_not_trained_again(tmp_path):
    first = _module()
    _run(first, tmp_path)
    again, seen = _module(), []
    _run(again, tmp_path, resume=True, report=seen.append)
    assert _equal(first, again) and not seen


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"width": 9}, "width = 8, now it is 9"),
        ({"seed": 4}, "seed = 0, now it is 4"),
        ({"steps": 70}, "steps = 60, now it is 70"),
        ({"content": {"take a": "1f"}}, 'take a = "0e", now it is "1f"'),
        ({"content": {}}, 'take a = "0e", now it is nothing'),
        ({"content": {"take a": "0e", "take b": "0e"}}, 'take b = nothing, now it is "0e"'),
    ],
)
def test_checkpoint_of_anything_else_is_begun_anew_and_said_so(tmp_path, change, named):
    given = {"content": {"take a": "0e"}}
    _run(_module(), tmp_path, **given)
    afresh, resumed, notes = _module(), _module(), []
    _run(afresh, **(given | change))
    _run(resumed, tmp_path, resume=True, notes=notes, **(given | change))
    assert _equal(afresh, resumed)
    [note] = notes
    assert note.startswith("toy.pt: training of toy starts again") and named in note
    assert len((tmp_path / "toy.jsonl").read_text().splitlines()) == change.get("steps", 60)
    _run(_module(), tmp_path, resume=True, notes=notes, **(given | change))
    assert len(notes) == 1  # the checkpoint is now of the same


class _Bomb:
    """Code, as a pickle: makes a file when it is loaded."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def _rewritten(content: bytes, path, data: bytes) -> None:
    """A checkpoint with other data, whose checksums are right."""
    path.write_bytes(content)
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, entry in entries.items():
            archive.writestr(name, data if name.endswith("data.pkl") else entry)


def _damaged(kind: str, content: bytes, path) -> None:
    rng = np.random.default_rng(0)
    garbled = bytearray(content)
    weights = torch.load(path, weights_only=True)["module"]["0.weight"].numpy().tobytes()
    garbled[content.index(weights)] ^= 0x40
    bomb = pickle.dumps(_Bomb(path.with_name("executed")), protocol=2)
    if kind == "code":
        _rewritten(content, path, bomb)
    elif kind == "no mapping":
        _rewritten(content, path, pickle.dumps([1, 2], protocol=2))
    else:
        path.write_bytes(
            {
                "empty": b"", "nonsense": b"nonsense",
                "half": content[: len(content) // 2], "500": content[:500],
                "without its end": content[:-1], "zeroed": bytes(len(content)), "one bit": bytes(garbled),
                "random": rng.bytes(5000), "bare code": bomb,
            }[kind]
        )  # fmt: skip


@pytest.mark.parametrize(
    "kind",
    [
        "empty", "nonsense", "half", "500", "without its end", "zeroed", "one bit", "random", "code",
        "bare code", "no mapping",
    ],
)  # fmt: skip
def test_damaged_checkpoint_is_named_and_begun_anew(tmp_path, kind):
    afresh, resumed, notes = _module(), _module(), []
    _run(afresh, tmp_path)
    path = tmp_path / "toy.pt"
    _damaged(kind, path.read_bytes(), path)
    _run(resumed, tmp_path, resume=True, notes=notes)
    assert _equal(afresh, resumed)
    [note] = notes
    assert (
        path.name in note
        and str(tmp_path) not in note
        and "starts again: the checkpoint is damaged" in note
        and "\n" not in note
    )
    assert not (tmp_path / "executed").exists()


def test_checkpoint_whose_parts_do_not_fit_leaves_nothing_behind(tmp_path):
    """The module's weights are restored before the optimizer's state is found not to fit."""
    afresh, resumed, notes = _module(), _module(), []
    _run(afresh, tmp_path)
    stored = torch.load(tmp_path / "toy.pt", weights_only=True)
    torch.save({**stored, "optimizer": {"state": {}, "param_groups": []}}, tmp_path / "toy.pt")
    _run(resumed, tmp_path, resume=True, notes=notes)
    assert len(notes) == 1 and _equal(afresh, resumed)


@pytest.mark.parametrize("cut", range(0, 12000, 997))
def test_checkpoint_cut_anywhere_is_begun_anew(tmp_path, cut):
    _run(_module(), tmp_path, steps=3)
    os.truncate(tmp_path / "toy.pt", min(cut, (tmp_path / "toy.pt").stat().st_size - 1))
    notes = []
    _run(_module(), tmp_path, resume=True, steps=3, notes=notes)
    assert len(notes) == 1


def test_loss_that_is_not_finite_stops_without_a_checkpoint(tmp_path):
    module = _module()

    def loss(rng, device):
        return module(torch.ones(2, 4)).sum() * float("nan")

    with pytest.raises(ChoreographError, match="finite loss, got nan"):
        train(
            module, loss, name="toy", n_steps=9, learning_rate=1e-2, weight_decay=0.0, seed=0,
            configuration={}, context=TrainingContext(tmp_path, device="cpu"),
        )  # fmt: skip
    assert not (tmp_path / "toy.pt").exists()


def test_unknown_device_and_weights_of_another_shape_are_refused():
    with pytest.raises(ParameterError, match="auto, cpu, cuda"):
        select_device("gpu0")
    with pytest.raises(ParameterError, match="another preset"):
        load_pretrained(_module(), "toy", {"0.weight": np.zeros((3, 3), np.float32)})


def test_batches_are_prepared_with_the_generators_of_their_steps():
    """In order, each once, and as a loss without them draws."""
    drawn = []

    def loss_of(numbers):
        return sum(p.square().sum() for p in module.parameters()) * float(numbers.mean())

    def weights(**given):
        nonlocal module
        torch.manual_seed(0)
        module = nn.Linear(2, 1)
        train(
            module, name="net", n_steps=5, learning_rate=0.1, weight_decay=0.0, seed=3, configuration={},
            **given,
        )  # fmt: skip
        return torch.cat([p.detach().flatten() for p in module.parameters()])

    def prepare(rng):
        drawn.append(rng.random(4))
        return drawn[-1]

    module = None
    alone = weights(loss=lambda rng, device: loss_of(rng.random(4)))
    beside = weights(loss=lambda numbers, device: loss_of(numbers), prepare=prepare)
    assert torch.equal(alone, beside)
    np.testing.assert_array_equal(drawn, [np.random.default_rng([3, step]).random(4) for step in range(5)])


def test_an_error_in_a_batch_is_raised():
    def prepare(rng):
        raise ParameterError("expected takes")

    with pytest.raises(ParameterError, match="expected takes"):
        train(
            nn.Linear(2, 1), lambda batch, device: batch, name="net", n_steps=2, learning_rate=0.1,
            weight_decay=0.0, seed=0, configuration={}, prepare=prepare,
        )  # fmt: skip
