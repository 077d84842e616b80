"""What the networks of a repertoire share: to arrays and back, and inference in batches."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from typing import Any, ClassVar, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from choreograph.errors import ParameterError

_BATCH_SIZE = 128  # at inference
_MAX_ITEMS = 16  # of a field of several values
_MAX_SIZE = 1e9  # of a number in a configuration


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
    def from_arrays(cls, arrays: Mapping[str, NDArray], config: Mapping[str, Any]) -> Self:
        """The network of `to_arrays`; `ParameterError` if weights and config disagree.

        Fields of the configuration may have the names that older files store (`renamed_fields`), or be
        missing there (`added_fields`).
        """
        values = {
            **cls.added_fields,
            **{cls.renamed_fields.get(key, key): value for key, value in config.items()},
        }
        unknown = set(values) - {field.name for field in fields(cls.config_class)}
        if unknown:
            raise ParameterError(
                f"expected fields of {cls.config_class.__name__}, got {', '.join(sorted(unknown))}"
            )
        # JSON has lists where the configuration has tuples.
        values = {key: tuple(v) if isinstance(v, list) else v for key, v in values.items()}
        _check_kinds(cls.config_class, values)
        config = cls.config_class(**values)
        mismatch = ParameterError(
            f"expected weights of the {cls.__name__} configured, got others: the file mixes versions"
        )
        try:
            with torch.device("meta"):  # shapes alone: a configuration may claim more than memory holds
                shapes = {key: tuple(value.shape) for key, value in cls(config).state_dict().items()}
        except (RuntimeError, ValueError, TypeError, IndexError, ArithmeticError) as error:
            raise ParameterError(f"{mismatch} ({str(error).splitlines()[0][:80]})") from error
        if shapes != {key: np.shape(value) for key, value in arrays.items()}:
            raise mismatch
        net = cls(config)
        net.load_state_dict({key: torch.from_numpy(np.array(value)) for key, value in arrays.items()})
        return net.eval()

    def _in_batches(self, n: int, infer: Callable[[slice], Tensor], *row_shape: int) -> NDArray[np.float32]:
        """Rows (n, ...) inferred batch by batch; `row_shape` is needed for n = 0."""
        self.eval()
        with torch.no_grad():
            parts = [infer(slice(i, i + _BATCH_SIZE)).numpy() for i in range(0, n, _BATCH_SIZE)]
        return np.concatenate(parts) if parts else np.zeros((0, *row_shape), np.float32)


def _check_kinds(config_class: type, values: Mapping[str, Any]) -> None:
    """`ParameterError` unless each value is of the kind of its field's default, and finite."""
    for field in fields(config_class):
        if field.name in values and not _is_like(values[field.name], field.default):
            got = reprlib.repr(values[field.name])
            raise ParameterError(
                f"expected {field.name} of {config_class.__name__} as {field.default!r} is, got {got}"
            )


def _is_like(value: Any, default: Any) -> bool:
    if isinstance(default, tuple):
        is_short = isinstance(value, tuple) and 0 < len(value) <= _MAX_ITEMS
        return is_short and all(_is_like(item, default[0]) for item in value)
    if isinstance(default, bool | str):
        return type(value) is type(default)
    kinds = int | float if isinstance(default, float) else int
    return isinstance(value, kinds) and not isinstance(value, bool) and abs(value) <= _MAX_SIZE
