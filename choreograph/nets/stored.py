"""What the networks of a repertoire share: to arrays and back, and inference in batches."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, ClassVar, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from choreograph.errors import ParameterError
from choreograph.nets.presets import check_fields
from choreograph.numerics import default_numerics

_BATCH_SIZE = 128  # at inference


class StoredNet(nn.Module):
    """A network that a file stores as its configuration and its weights."""

    config_class: ClassVar[type]
    renamed_fields: ClassVar[Mapping[str, str]] = {}  # of the configuration, old to new: for older files
    added_fields: ClassVar[Mapping[str, Any]] = {}  # values of fields that older files do not have
    config: Any  # of `config_class`

    def to_arrays(self) -> tuple[dict[str, NDArray], dict[str, Any]]:
        """Weights by name, and the configuration as a plain dictionary."""
        return {n: v.detach().cpu().numpy() for n, v in self.state_dict().items()}, asdict(self.config)

    @classmethod
    @default_numerics()
    def from_arrays(cls, arrays: Mapping[str, NDArray], config: Mapping[str, Any]) -> Self:
        """The network of `to_arrays`; `ParameterError` if weights and config disagree.

        Fields of the configuration may have the names that older files store (`renamed_fields`), or be
        missing there (`added_fields`).
        """
        values = {
            **cls.added_fields,
            **{cls.renamed_fields.get(key, key): value for key, value in config.items()},
        }
        values = check_fields(cls.config_class, values)
        config = cls.config_class(**values)
        mismatch = ParameterError(
            f"expected weights of the {cls.__name__} configured, got others: the file mixes versions"
        )
        try:
            # Shapes alone: a configuration may claim more than memory holds, and weights are not drawn.
            with torch.device("meta"):
                net = cls(config)
        except (RuntimeError, ValueError, TypeError, IndexError, ArithmeticError) as error:
            raise ParameterError(f"{mismatch} ({str(error).splitlines()[0][:80]})") from error
        expected = net.state_dict()
        if {key: tuple(value.shape) for key, value in expected.items()} != {
            key: np.shape(value) for key, value in arrays.items()
        }:
            raise mismatch
        weights = {key: torch.from_numpy(np.array(value)) for key, value in arrays.items()}
        weights = {key: value.to(expected[key].dtype) for key, value in weights.items()}
        net.load_state_dict(weights, assign=True)
        return net.eval()

    def _in_batches(self, n: int, infer: Callable[[slice], Tensor], *row_shape: int) -> NDArray[np.float32]:
        """Rows (n, ...) inferred batch by batch; `row_shape` is needed for n = 0."""
        self.eval()
        with torch.no_grad():
            parts = [infer(slice(i, i + _BATCH_SIZE)).numpy() for i in range(0, n, _BATCH_SIZE)]
        return np.concatenate(parts) if parts else np.zeros((0, *row_shape), np.float32)
