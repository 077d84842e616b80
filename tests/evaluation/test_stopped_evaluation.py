"""Evaluations that are stopped go on where they were; what cannot be danced is known before anything is."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from command_line import assert_one_line, run
from synthetic_repertoire import synthetic_repertoire, write_clicks

from choreograph.core.errors import NoPathError, RepertoireError
from choreograph.evaluation import run as run_module
from choreograph.evaluation.results import to_json
from choreograph.evaluation.run import EvaluationConfig, dance_variant, evaluate_variants, kept_dances
from choreograph.evaluation.songs import find_songs
from research.variants import variants_named

pytestmark = pytest.mark.slow

# The command, that waits to be stopped as soon as it has made as many dances as its first argument says.
WAITING_COMMAND = """
import sys, time
from choreograph.cli.main import main
from choreograph.evaluation import run
enough, made, dance = int(sys.argv.pop(1)), [], run.dance_variant
def dance_or_wait(*args, **kwargs):
    if len(made) == enough:
        time.sleep(600)
    made.append(1)
    return dance(*args, **kwargs)
run.dance_variant = dance_or_wait
main()
"""

VARIANTS = ["random", "greedy-published"]


@pytest.fixture(scope="module")
def db(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("db") / "rep.h5", vocabulary=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("songs")
    for name, bpm in (("slow", 100), ("quick", 120)):
        write_clicks(folder / f"{name}.wav", duration_s=5.0, bpm=bpm)
    return folder


@pytest.fixture(scope="module")
def config():
    return EvaluationConfig(variants_named(VARIANTS), seeds=2)


@pytest.fixture(scope="module")
def uninterrupted(db, folder, config):
    return to_json(evaluate_variants(db, find_songs(folder), config))


def stopping(monkeypatch, after: int, error: type[BaseException]) -> list[str]:
    """Dances are made until there are `after`; the list says which."""
    made: list[str] = []

    def danced(variant, song, repertoire, **given):
        if len(made) == after:
            raise error
        made.append(f"{song.name} {variant.name} {given['seed']}")
        return dance_variant(variant, song, repertoire, **given)

    monkeypatch.setattr(run_module, "dance_variant", danced)
    return made


@pytest.mark.parametrize("error", [NoPathError, KeyboardInterrupt])
def test_what_was_danced_is_not_danced_again_and_the_results_are_the_same(
    db, folder, config, uninterrupted, tmp_path, monkeypatch, error
):
    songs, kept_in = find_songs(folder), tmp_path / "e.json.dances"
    first = stopping(monkeypatch, 4, error)
    with pytest.raises(error), kept_dances(kept_in, resume=False, doing="evaluates") as kept:
        evaluate_variants(db, songs, config, kept=kept)
    assert len(kept) == len(first) == 4
    second = stopping(monkeypatch, 99, error)
    with kept_dances(kept_in, resume=True, doing="evaluates") as kept:
        resumed = evaluate_variants(db, songs, config, kept=kept)
    assert len(second) == 2 and not set(first) & set(second)
    assert to_json(resumed) == uninterrupted
    assert not kept_in.exists()


def test_kept_dances_of_anything_else_or_damaged_are_danced_again(
    db, folder, config, uninterrupted, tmp_path, monkeypatch
):
    songs, kept_in = find_songs(folder), tmp_path / "e.json.dances"
    stopping(monkeypatch, 5, KeyboardInterrupt)
    with pytest.raises(KeyboardInterrupt), kept_dances(kept_in, resume=False, doing="evaluates") as kept:
        evaluate_variants(db, songs, config, kept=kept)
    one, other, third, *_ = sorted(kept_in.glob("*.json"))
    one.write_text("{")
    os.truncate(other.with_suffix(".npz"), 300)
    third.write_text(json.dumps({"plan": {}, "notes": []}))
    again = stopping(monkeypatch, 99, KeyboardInterrupt)
    with kept_dances(kept_in, resume=True, doing="evaluates") as kept:
        assert to_json(evaluate_variants(db, songs, config, kept=kept)) == uninterrupted
    assert len(again) == 1 + 3
    # Without --resume, with songs of another duration, or another repertoire, all are danced anew.
    stopping(monkeypatch, 5, KeyboardInterrupt)
    with pytest.raises(KeyboardInterrupt), kept_dances(kept_in, resume=False, doing="evaluates") as kept:
        evaluate_variants(db, songs, config, kept=kept)
    shorter, anew = find_songs(folder, duration_s=4.0), stopping(monkeypatch, 99, KeyboardInterrupt)
    with kept_dances(kept_in, resume=True, doing="evaluates") as kept:
        evaluate_variants(db, shorter, config, kept=kept)
    assert len(anew) == 6


@pytest.mark.parametrize("variants", ["engines", "rollout", "as-published"])
def test_a_variant_that_cannot_be_danced_is_known_before_anything_is(
    db, folder, tmp_path, monkeypatch, variants
):
    made = stopping(monkeypatch, 0, AssertionError)
    with pytest.raises(RepertoireError):
        evaluate_variants(db, find_songs(folder), EvaluationConfig(variants_named([variants])))
    result = run("evaluate", "--db", db.path, "--songs", folder, "--variants", variants, "--json",
                 tmp_path / "e.json")  # fmt: skip
    assert_one_line(result, says="as-published" if variants == "as-published" else "rollout")
    assert not made and not list(tmp_path.iterdir())


def test_a_killed_command_goes_on(db, folder, tmp_path):
    """By Ctrl-C, then by kill -9, until it is through; the same as without."""
    output = tmp_path / "e.json"
    arguments = ["evaluate", "--db", str(db.path), "--songs", str(folder), "--seeds", "2", "-q",
                 "--variants", "random", "--json", str(output)]  # fmt: skip
    folder_of = tmp_path / "e.json.dances"
    for number, more, made, kept in ((signal.SIGINT, [], 1, 1), (signal.SIGKILL, ["--resume"], 2, 3)):
        process = subprocess.Popen(
            [sys.executable, "-c", WAITING_COMMAND, str(made), *arguments, *more],
            stderr=subprocess.PIPE, text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # ignored in background jobs
        )  # fmt: skip
        while len(list(folder_of.glob("[!.o]*.json"))) < kept:
            assert process.poll() is None
            time.sleep(0.005)
        process.send_signal(number)
        _, told = process.communicate()
        assert not output.exists()
        if number == signal.SIGINT:
            assert process.returncode == 130 and "--resume continues" in told and "Traceback" not in told
    assert run(*arguments, "--resume").exit_code == 0
    resumed = output.read_text()
    assert run(*arguments).exit_code == 0
    assert output.read_text() == resumed
    assert [path.name for path in tmp_path.iterdir()] == ["e.json"]


def test_resuming_needs_a_place(db, folder):
    result = run("evaluate", "--db", db.path, "--songs", folder, "--resume")
    assert_one_line(result, says="--report or --json")
