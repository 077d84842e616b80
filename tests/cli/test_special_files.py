"""Pipes, devices, sockets and folders where files belong, and names that are no text: no command waits."""

from __future__ import annotations

import os
import signal
import socket
from pathlib import Path

import pytest
from command_line import assert_one_line, run
from synthetic_motions import stepping

from choreograph.core.errors import FormatError
from choreograph.formats.register import import_takes, save_motion

WAIT_S = 300  # a whole dance, its kernels compiled anew beside other tests, takes over a minute


class Waited(BaseException):
    """A command that waits for what never comes."""


@pytest.fixture(autouse=True)
def _impatient():
    def give_up(*_):
        raise Waited

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(WAIT_S)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(params=["pipe", "device", "socket", "folder", "stdin"])
def special(request, tmp_path, monkeypatch):
    """Makes a thing that is no file, with a given name."""

    def make(name: str) -> Path:
        path = tmp_path / name
        if request.param == "pipe":
            os.mkfifo(path)
        elif request.param == "folder":
            path.mkdir()
        elif request.param == "socket":
            monkeypatch.chdir(tmp_path)  # the path of a socket may have 108 characters
            with socket.socket(socket.AF_UNIX) as server:
                server.bind(name)
        else:
            path.symlink_to("/dev/zero" if request.param == "device" else "/dev/stdin")
        return path

    return make


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("dance", "SPECIAL"), "song.mp3"),
        (("dance", "SONG", "--db", "SPECIAL"), "rep.h5"),
        (("dance", "SONG", "--config", "SPECIAL"), "config.toml"),
        (("dance", "SONG", "--beats", "SPECIAL"), "song.beats"),
        (("dance", "--plan", "SPECIAL"), "plan.json"),
        (("dance", "SONG", "--db", "DB", "--signature", "SPECIAL"), "signature.json"),
        (("dance", "SONG", "--db", "DB", "--motifs", "SPECIAL"), "motifs.json"),
        (("dance", "SONG", "--db", "DB", "--motifs", "SPECIAL"), "take.bvh"),
        *(
            (("dance", "SONG", "--db", "DB", "--keep", "0-1", "--existing", "SPECIAL"), f"dance.{suffix}")
            for suffix in ("bvh", "npz", "json")
        ),
        (("dance", "SONG", "--character", "SPECIAL"), "hero.glb"),
        *(
            (("build-db", "SPECIAL", "-o", "OUT.h5"), f"take.{suffix}")
            for suffix in ("bvh", "npz", "c3d", "glb")
        ),
        (("build-db", "SPECIAL", "-o", "OUT.h5", "--leave-out", "@SPECIAL"), "names.txt"),
        (("build-db", "SPECIAL", "-o", "OUT.h5", "--init-from", "SPECIAL"), "old.h5"),
        (("inspect", "SPECIAL"), "rep.h5"),
        (("convert", "SPECIAL", "OUT.bvh"), "take.bvh"),
    ],
)
def test_what_is_no_file_is_refused_in_a_line(special, db_with_motifs, song, tmp_path, arguments, name):
    path = special(name)
    places = {"SPECIAL": path, "SONG": song, "DB": db_with_motifs, "@SPECIAL": f"@{path}"}
    words = [places.get(word, str(word).replace("OUT", str(tmp_path / "out"))) for word in arguments]
    if words[0] == "dance":
        words += ["-o", tmp_path / ("dance.glb" if "--character" in words else "dance.npz")]
    assert_one_line(run(*words), says=name)
    assert not (tmp_path / "out.h5").exists()


@pytest.mark.parametrize("name", ["manifest.csv", "take.counts.csv", "take.mp4"])
def test_what_is_no_file_beside_a_take_is_refused_or_left_out(special, tmp_path, name):
    save_motion(tmp_path / "take.bvh", stepping(60))
    special(name)
    if name == "take.mp4":  # as a video without sound is
        (take,) = import_takes(tmp_path)
        assert take.song_path is None
    else:
        with pytest.raises(FormatError, match=name):
            list(import_takes(tmp_path))


@pytest.mark.parametrize("n", [0, -1, 1001, 10**8])
def test_no_one_wants_that_many_variations(song, db, n):
    assert_one_line(run("dance", song, "--db", db, "--variations", n), says="1 to 1000 variations")


def test_a_name_that_is_no_text(song, db, tmp_path):
    """It is shown as it is, byte for byte, and is part of what is written."""
    named = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9.wav"))
    named.write_bytes(song.read_bytes())
    outputs = [named.with_suffix(suffix) for suffix in (".bvh", ".html", ".json")]
    result = run("dance", named, "--db", db, *(word for path in outputs for word in ("-o", path)))
    assert result.exit_code == 0, result.output
    assert b"caf\xe9.bvh" in result.stdout_bytes
    assert all(path.exists() for path in outputs)
    missing = named.with_name(named.name + ".mp3")
    assert_one_line(run("dance", missing, "--db", db, "-o", outputs[0]), says=".wav.mp3")


@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_nothing_is_written_over_what_is_no_file(song, db, tmp_path, kind):
    path = tmp_path / "dance.npz"
    os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/zero")
    assert_one_line(run("dance", song, "--db", db, "-o", path), says="cannot write")
    assert not path.is_file()
