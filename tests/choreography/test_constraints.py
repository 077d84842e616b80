"""Pins, bans, signatures and motif sequences as text and files, and what is none."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_motions import swaying
from synthetic_pages import plan_for

from choreograph.choreography.constraints import (
    Ban,
    Constraints,
    Keep,
    MotifPin,
    TakePin,
    excludes,
    parse_ban,
    parse_pin,
    read_motifs,
    read_signature,
    write_signature,
)
from choreograph.choreography.slots import resolve_bans
from choreograph.core.errors import FormatError, ParameterError
from choreograph.motion.motion import Credits
from choreograph.plan.plan import PlannedWord


@pytest.mark.parametrize(
    "constraint",
    [MotifPin(12.0, 41), MotifPin(0.25, 0), TakePin(30.0, 38.5, "DANCE_W_3"), TakePin(0.0, 1.0, "a=b:c")],
)
def test_pins_print_as_they_are_parsed(constraint):
    assert parse_pin(str(constraint)) == constraint


@pytest.mark.parametrize(
    "ban",
    [Ban(take="a b"), Ban(genre="cha-cha"), Ban(motif=0), Ban(performer="Ana: B"), Ban(licence="CC BY 4.0")],
)
def test_bans_print_as_they_are_parsed(ban):
    assert parse_ban(str(ban)) == ban


@pytest.mark.parametrize(
    "text",
    ["", "12", "12=41", "12=motif:", "12=motif:-1", "12=motif:x", "12=take:A", "1-2=motif:3", "-3=motif:1",
     "1.2.3=motif:4", "1-2=take:", "a-b=take:A"],
)  # fmt: skip
def test_malformed_pins(text):
    with pytest.raises(ParameterError, match="--pin"):
        parse_pin(text)


def test_a_ban_excludes_the_takes_with_its_name_or_credits():
    credits = Credits(genre="waltz", performer="Ana", licence="CC0")
    for ban in (Ban(take="w"), Ban(genre="waltz"), Ban(performer="Ana"), Ban(licence="CC0")):
        assert excludes(ban, "w", credits)
    for ban in (Ban(take="Ana"), Ban(genre="CC0"), Ban(performer="waltz"), Ban(licence="w"), Ban(motif=1)):
        assert not excludes(ban, "w", credits)


def test_takes_that_may_be_danced_beside_bans():
    of_ben = Credits("waltz", "Ben", "all rights reserved")
    credits = [Credits("waltz", "Ana", "CC0"), of_ben, Credits("tango", "Ana", "")]
    takes = [SimpleNamespace(name=f"take{index}", credits=of_take) for index, of_take in enumerate(credits)]
    repertoire = SimpleNamespace(takes=takes)

    def allowed(*bans):
        return resolve_bans(Constraints(bans=bans), repertoire, 0)[0].tolist()

    assert allowed(Ban(performer="Ana")) == [False, True, False]
    assert allowed(Ban(licence="all rights reserved")) == [True, False, True]
    assert allowed(Ban(licence="CC0"), Ban(genre="tango")) == [False, True, False]
    with pytest.raises(ParameterError, match="ban of a performer among Ana, Ben, got 'Eva'"):
        allowed(Ban(performer="Eva"))
    with pytest.raises(ParameterError, match="ban of a licence among CC0, all rights reserved, got 'MIT'"):
        allowed(Ban(licence="MIT"))
    with pytest.raises(ParameterError, match="every take is banned"):
        allowed(Ban(performer="Ana"), Ban(performer="Ben"))


@pytest.mark.parametrize("text", ["", "take", "take:", "motif:x", "motif:-1", "song:a", "genre:", "licence:"])
def test_malformed_bans(text):
    with pytest.raises(ParameterError, match="--ban"):
        parse_ban(text)


def test_signatures_round_trip(tmp_path):
    shares = np.array([0.1, 0.2, 0.7])
    write_signature(tmp_path / "mine.json", shares, name="waltz", repertoire="rep.h5")
    np.testing.assert_allclose(read_signature(tmp_path / "mine.json"), shares)


@pytest.mark.parametrize(
    "data",
    [
        "{", "[0.5, 0.5]", {"format": "choreograph-signature"}, {"format": "x", "shares": [1.0]},
        {"format": "choreograph-signature", "shares": [0.5, 0.4]},
        {"format": "choreograph-signature", "shares": [1.5, -0.5]},
        {"format": "choreograph-signature", "shares": ["1"]},
        {"format": "choreograph-signature", "shares": []},
    ],
)  # fmt: skip
def test_malformed_signatures(tmp_path, data):
    path = tmp_path / "as_given.json"
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    with pytest.raises(FormatError, match="as_given") as raised:
        read_signature(path)
    assert "\n" not in str(raised.value)


def test_motif_sequences_of_every_kind(tmp_path):
    path = tmp_path / "of_moves.json"
    path.write_text("[3, 41, 7]")
    assert read_motifs(path) == (3, 41, 7)
    path.write_text('[{"at_s": 1.5, "motif": 4}, {"at_s": 12, "motif": 0}]')
    assert read_motifs(path) == (MotifPin(1.5, 4), MotifPin(12, 0))
    plan = plan_for(swaying(120, fps=60.0))
    word = PlannedWord(0.5, 1.0, 7, "anna-waltz", 3.0, 3.6, Credits(), True)
    path.write_text(replace(plan, words=(word,)).to_json())
    assert read_motifs(path) == (MotifPin(0.75, 7),)
    whole = (replace(word, start_s=0.0), replace(word, start_s=1.0, end_s=2.0, motif=9))
    path.write_text(replace(plan, engine="mixer", seconds=(), words=whole).to_json())
    assert read_motifs(path) == (7, 9)


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", "[1, -2]", "[1, 2.5]", "[true]", '[{"at_s": 1}]', "[1, [2]]"]
)
def test_malformed_motif_sequences(tmp_path, text):
    (tmp_path / "of_moves.json").write_text(text)
    with pytest.raises(FormatError, match="of_moves"):
        read_motifs(tmp_path / "of_moves.json")
    (tmp_path / "of_moves.json").write_text(plan_for(swaying(120, fps=60.0)).to_json())
    with pytest.raises(FormatError, match="only seconds"):
        read_motifs(tmp_path / "of_moves.json")


@pytest.mark.parametrize(
    "make",
    [
        lambda: MotifPin("x", 1),
        lambda: MotifPin(float("nan"), 1),
        lambda: MotifPin(1.0, "y"),
        lambda: MotifPin(1.0, -1),
        lambda: MotifPin(1.0, True),
        lambda: TakePin("x", 3, "take"),
        lambda: TakePin(1.0, None, "take"),
        lambda: TakePin(1.0, 3.0, 2),
        lambda: Keep(b"", 3.0),
        lambda: Ban(take=3),
        lambda: Ban(genre=["waltz"]),
        lambda: Ban(motif="3"),
        lambda: Ban(),
    ],
)
def test_constraints_of_wrong_types_are_refused_when_they_are_made(make):
    with pytest.raises(ParameterError, match=r"^expected [^\n]+, got [^\n]+$"):
        make()
