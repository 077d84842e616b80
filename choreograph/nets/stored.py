"""What the networks of a repertoire share: their way into its file and back, and running many segments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from typing import Any, ClassVar, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from choreograph.errors import ParameterError

_BATCH = 128  # at inference


class StoredNet(nn.Module):
    """A network made from a configuration, kept as arrays and that configuration."""

    config_class: ClassVar[type]
    config: Any  # of that class

    def to_arrays(self) -> tuple[dict[str, NDArray], dict[str, Any]]:
        """Weights by name, and the configuration as a plain dictionary: what a file needs to keep."""
        return {n: v.detach().cpu().numpy() for n, v in self.state_dict().items()}, asdict(self.config)

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray], config: Mapping[str, Any]) -> Self:
        """The network that `to_arrays` described; `ParameterError` if weights and config disagree."""
        name = cls.config_class.__name__
        unknown = set(config) - {field.name for field in fields(cls.config_class)}
        if unknown:
            raise ParameterError(f"expected fields of {name}, got {', '.join(sorted(unknown))}")
        tuples = {key: tuple(v) if isinstance(v, list) else v for key, v in config.items()}
        net = cls(cls.config_class(**tuples))
        try:
            net.load_state_dict({key: torch.from_numpy(np.array(value)) for key, value in arrays.items()})
        except RuntimeError as error:
            raise ParameterError(
                f"expected weights of the {cls.__name__} described, got others: the file mixes versions"
            ) from error
        return net.eval()

    def _in_batches(self, n: int, computed: Callable[[slice], Tensor], *row: int) -> NDArray[np.float32]:
        """Rows (n, ...) computed a batch at a time; `row` is the shape of one, for n = 0."""
        self.eval()
        with torch.no_grad():
            parts = [computed(slice(i, i + _BATCH)).numpy() for i in range(0, n, _BATCH)]
        return np.concatenate(parts) if parts else np.zeros((0, *row), np.float32)
