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


class UnknownTypeError(Refusal):
    """A file whose name has a suffix that is not read here."""

    status = 415
