"""Reasons for which the studio refuses a request, each with its HTTP status."""

from __future__ import annotations

from choreograph.core.errors import ChoreographError


class Refusal(ChoreographError):
    """A request that cannot be served. `status` is its HTTP status."""

    status = 400


class NotFoundError(Refusal):
    """Something that was asked for does not exist."""

    status = 404


class ForbiddenError(Refusal):
    """A request from another site, to another name of this machine, or without the token."""

    status = 403


class ConflictError(Refusal):
    """A change of a state that is no longer the newest."""

    status = 409


class TooLargeError(Refusal):
    """More bytes than a request of its kind may have."""

    status = 413

    def __init__(self, most: int) -> None:
        """`most` is the number of bytes that it may have."""
        size = f"{most >> 20} MiB" if most >= 1 << 20 else f"{most} bytes"
        super().__init__(f"expected at most {size} in this request, got more or an unknown length")


class UnknownTypeError(Refusal):
    """A file whose name has a suffix that is not read here."""

    status = 415
