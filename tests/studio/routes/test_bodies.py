"""Bodies and uploads: unknown fields are refused, and what was not received whole leaves nothing."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import pytest
from pydantic import ValidationError

from choreograph.core.errors import FormatError, ParameterError
from choreograph.studio.refusals import TooLargeError, UnknownTypeError
from choreograph.studio.routes.bodies import (
    AlternativesBody,
    EditBody,
    LocksBody,
    SeamBody,
    received,
    uploaded,
)


def sent(folder, name, *chunks, most_bytes=10):
    async def stream():
        for chunk in chunks:
            if isinstance(chunk, Exception):
                raise chunk
            yield chunk

    request = SimpleNamespace(headers={"x-filename": name}, stream=stream)
    return asyncio.run(uploaded(request, folder, (".wav",), most_bytes))


@pytest.mark.parametrize(
    ("body", "data"),
    [
        (EditBody, {"kind": "dance"}), (EditBody, {"kind": "swap", "more": 1}),
        (EditBody, {"kind": "swap", "from": -1}),
        (EditBody, {"kind": "swap", "from": float("nan")}), (EditBody, {"kind": "swap", "take": "x" * 301}),
        (LocksBody, {"locks": [[1.0, 2.0]] * 501}), (LocksBody, {"locks": [[1.0]]}),
        (LocksBody, {"locks": [], "revision": -1}), (SeamBody, {"at": 1.0, "counts": 257}),
        (AlternativesBody, {"from": 1.0, "to": 2.0, "n": 25}), (AlternativesBody, {"from": 1.0}),
    ],
)  # fmt: skip
def test_a_field_that_is_not_valid_is_refused(body, data):
    with pytest.raises(ValidationError):
        body.model_validate({"revision": 1} | data)


def test_the_edges_of_fields_are_valid():
    assert EditBody.model_validate({"revision": 0, "kind": "swap", "from": 0, "to": 86_400}).to_s == 86_400
    assert SeamBody.model_validate({"revision": 1, "at": 1, "counts": -256}).counts == -256


def test_a_file_is_received_whole_under_its_name(tmp_path):
    path = sent(tmp_path, "a%20b.wav", b"01234", b"56789")
    assert path.name == "a b.wav" and path.read_bytes() == b"0123456789"
    with received(path):
        assert path.is_file()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "chunks", "error"),
    [
        ("a.wav", (b"0" * 10, b"1"), TooLargeError), ("a.exe", (b"0",), UnknownTypeError),
        ("..%2Fa.wav", (b"0",), ParameterError), ("", (b"0",), ParameterError),
        ("a.wav", (b"0", RuntimeError("gone")), RuntimeError),
    ],
)  # fmt: skip
def test_what_is_refused_leaves_nothing(tmp_path, name, chunks, error):
    with pytest.raises(error):
        sent(tmp_path, name, *chunks)
    assert list(tmp_path.iterdir()) == []


def test_errors_name_a_file_without_its_folder(tmp_path):
    path = sent(tmp_path, "a.wav", b"0")
    with pytest.raises(FormatError, match=r"^a\.wav: expected a song$"), received(path):
        raise FormatError(f"{path}: expected a song")
    assert list(tmp_path.iterdir()) == []
