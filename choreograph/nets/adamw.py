"""AdamW with the arithmetic of torch, without its class, which imports torch's compiler in 0.9 s."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import torch
from torch.optim.adamw import adamw

_BETA1, _BETA2, _EPSILON = 0.9, 0.999, 1e-8  # the defaults of torch
_MOMENTS = ("exp_avg", "exp_avg_sq")


class AdamW:
    """As `torch.optim.AdamW` with its default settings, to the bit, with a learning rate for each step.

    Loshchilov and Hutter, Decoupled weight decay regularization (2019).
    """

    def __init__(self, parameters: Iterable[torch.nn.Parameter], weight_decay: float) -> None:
        self._parameters = list(parameters)
        self._weight_decay = weight_decay
        self._state: dict[int, dict[str, torch.Tensor]] = {}  # by the index of a parameter with gradients

    def zero_grad(self) -> None:
        """Remove all gradients."""
        for parameter in self._parameters:
            parameter.grad = None

    @torch.no_grad()
    def step(self, learning_rate: float) -> None:
        """Change the parameters that have gradients."""
        known = [(i, one, one.grad) for i, one in enumerate(self._parameters) if one.grad is not None]
        for i, parameter, _ in known:
            if i not in self._state:
                moments = {name: torch.zeros_like(parameter) for name in _MOMENTS}
                self._state[i] = {"step": torch.tensor(0.0, dtype=torch.float32), **moments}
        states = [self._state[i] for i, _, _ in known]
        first, second = ([state[name] for state in states] for name in _MOMENTS)
        adamw(
            [parameter for _, parameter, _ in known], [grad for _, _, grad in known], first, second, [],
            [state["step"] for state in states], amsgrad=False, beta1=_BETA1, beta2=_BETA2, lr=learning_rate,
            weight_decay=self._weight_decay, eps=_EPSILON, maximize=False,
        )  # fmt: skip

    def state_dict(self) -> dict[str, Any]:
        """The state, in the form of torch's optimizers."""
        return {"state": self._state, "param_groups": [{"params": list(range(len(self._parameters)))}]}

    def load_state_dict(self, stored: Mapping[str, Any]) -> None:
        """Continue from a state, also from one of `torch.optim.AdamW`.

        Raises `KeyError`, `IndexError` or `ValueError` if it is of other parameters.
        """
        if stored["param_groups"][0]["params"] != list(range(len(self._parameters))):
            raise ValueError(f"expected a state of {len(self._parameters)} parameters, got another one")
        state = {}
        for i, values in stored["state"].items():
            parameter = self._parameters[i]
            moments = {name: values[name].to(parameter, copy=True) for name in _MOMENTS}
            if any(moment.shape != parameter.shape for moment in moments.values()):
                raise ValueError(f"expected moments of {tuple(parameter.shape)}, got others")
            state[i] = {"step": values["step"].to("cpu", torch.float32, copy=True), **moments}
        self._state = state
