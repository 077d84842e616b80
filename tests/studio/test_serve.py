"""The command: a real server, which is killed while it saves, and what it says if something is missing."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from http.client import HTTPException
from pathlib import Path
from urllib.request import Request, urlopen

import pytest
from command_line import run

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.studio.project import project_from_json
from choreograph.studio.project_file import ProjectFile
from choreograph.studio.serve import _listening, serve, start


def ask(address, path, body=None):
    data = None if body is None else json.dumps(body).encode()
    with urlopen(Request(address + path, data, {"Content-Type": "application/json"})) as reply:
        return json.loads(reply.read())


def started(song, repertoire, *options):
    command = [sys.executable, "-m", "choreograph", "studio", str(song), "--no-browser", "--db"]
    process = subprocess.Popen([*command, str(repertoire.path), *options], stdout=subprocess.PIPE, text=True)
    return process, process.stdout.readline().split()[-1].rstrip("/")


@pytest.mark.slow
def test_a_server_that_is_killed_while_it_saves_loses_no_saved_change(folder, repertoire):
    song, path = folder / "clicks.wav", folder / "clicks.studio.json"
    revision = 0
    for wait_s in (0.0, 0.02, 0.1):
        process, address = started(song, repertoire)
        while ask(address, "/api/state")["dance"] is None:
            time.sleep(0.05)
        state = ask(address, "/api/state")
        assert state["revision"] >= max(revision, 1)
        seen = [state["revision"]]
        thread = threading.Thread(target=_change_until_killed, args=(address, seen))
        thread.start()
        while seen[-1] < state["revision"] + 5:
            time.sleep(0.005)
        time.sleep(wait_s)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        thread.join()
        revision = seen[-1]  # what the page has seen as saved
        assert project_from_json(path.read_text(), "p").revision >= revision
    left = [name for name in os.listdir(folder) if name.startswith(".") and not name.endswith(".lock")]
    assert len(left) <= 1  # a temporary file of the last kill, which the next save removes
    file = ProjectFile(path)
    file.write(file.read())
    file.close()
    assert [name for name in os.listdir(folder) if name.startswith(".")] == []


def _change_until_killed(address, seen):
    """Lock and unlock a part until the server is gone, and note each revision that it has confirmed."""
    locks = [[[1.0, 2.0]], [[1.0, 3.0]]]
    try:
        while True:
            body = {"revision": seen[-1], "locks": locks[seen[-1] % 2]}
            seen.append(ask(address, "/api/locks", body)["revision"])
    except (OSError, ValueError, HTTPException):
        return


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_command_serves_news_and_ends_when_stopped(number, folder, repertoire, tmp_path, monkeypatch):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setenv("TMPDIR", str(scratch))
    process, address = started(folder / "clicks.wav", repertoire, "--port", "0")
    stream = urlopen(address + "/api/events")
    assert stream.headers["content-type"].startswith("text/event-stream")
    while ask(address, "/api/state")["dance"] is None:
        time.sleep(0.05)
    ask(address, "/api/locks", {"revision": 1, "locks": [[1.0, 2.0]]})
    news: list[dict] = []
    while not any(one.get("state") == 2 for one in news):
        line = stream.readline().decode()
        news += [json.loads(line.removeprefix("data: "))] if line.startswith("data: ") else []
    assert any("job" in one for one in news)
    second = subprocess.run(
        [sys.executable, "-m", "choreograph", "studio", str(folder / "clicks.wav"), "--no-browser"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert second.returncode == 2 and "works on clicks.studio.json" in second.stderr
    assert list(scratch.glob("choreograph-studio-*"))
    process.send_signal(number)
    assert process.wait(timeout=20) in (0, 128 + number, -signal.SIGINT)
    assert not list(folder.glob(".*lock")) and not list(scratch.glob("choreograph-studio-*"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["missing.mp3"], "missing.mp3"), (["--project", "missing.json"], "missing.json"),
        (["--port", "99999"], "99999"), (["a.wav", "--project", "other/b.json"], "beside its song"),
        (["--character", "missing.glb"], "missing.glb"), (["--db", "missing.h5"], "missing.h5"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.wav").write_bytes(b"x")
    result = run("studio", "--no-browser", *arguments)
    assert result.exit_code == 2 and said in result.output
    assert len(result.output.strip().splitlines()[-1]) < 300


def test_without_the_extra_the_cure_is_said_in_one_line(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in [name for name in sys.modules if name.startswith("choreograph.studio.serve")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    result = run("studio", "--no-browser")
    assert result.exit_code == 2 and "choreograph[studio]" in result.output
    assert len(result.output.strip().splitlines()) == 1


def test_a_port_in_use_is_said_in_one_line(tmp_path, monkeypatch):
    import socket

    monkeypatch.chdir(tmp_path)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        result = run("studio", "--no-browser", "--port", str(taken.getsockname()[1]))
    assert result.exit_code == 2 and "--port" in result.output
    assert Path("clicks.studio.json").exists() is False


def test_a_studio_without_a_song_works_in_the_working_folder(repertoire, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    service = start(None, repertoire)
    service.close()
    assert service.desk.folder == tmp_path and service.state()["song"] is None
    assert list(tmp_path.iterdir()) == []


def test_a_project_opens_its_song(open_studio, folder):
    open_studio(folder / "clicks.wav").ready().service.close()
    again = open_studio(None, project=folder / "clicks.studio.json").ready()
    assert again.service.desk.folder == folder
    assert again.state()["project"] == {"name": "clicks.wav", "file": "clicks.studio.json"}
    assert again.revision == 1  # the dance was not made a second time


def test_links_to_a_project_and_to_a_song_stay_links(open_studio, folder, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("links")
    song, project = elsewhere / "linked.wav", elsewhere / "mine.studio.json"
    song.symlink_to(folder / "clicks.wav")
    project.symlink_to(folder / "clicks.studio.json")
    first = open_studio(folder / "clicks.wav").ready()
    with pytest.raises(ChoreographError, match="works on clicks"):
        open_studio(None, project=project)
    first.service.close()
    again = open_studio(None, project=project).ready()  # the song is beside the file that the link leads to
    assert again.post("/api/locks", revision=1, locks=[[1.0, 2.0]]).status_code == 200
    again.service.close()
    assert project.is_symlink() and project_from_json(project.read_text(), "p").revision == 2
    open_studio(song).ready()  # a link is a song with a project of its own
    assert song.is_symlink()
    names = {name for name in os.listdir(elsewhere) if not name.endswith(".lock")}
    assert names == {"linked.wav", "linked.studio.json", "mine.studio.json"}


def test_a_studio_that_cannot_start_leaves_nothing(repertoire, folder, tmp_path_factory, monkeypatch):
    scratch = tmp_path_factory.mktemp("scratch")
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    (folder / "clicks.studio.json").write_text("{")
    with pytest.raises(FormatError) as refused:  # which would keep the studio alive
        start(folder / "clicks.wav", repertoire)
    assert list(scratch.iterdir()) == [] and refused.value


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"\xff\xfe", b'{"song": "clicks.wav"}', b'{"song": "../clicks.wav", "steps": []}'],
)
def test_a_damaged_project_is_refused_and_released(repertoire, folder, content):
    path = folder / "clicks.studio.json"
    path.write_bytes(content)
    for _ in range(2):  # the second time would find a lock that was left
        with pytest.raises((FormatError, ParameterError), match=r"clicks\.studio\.json") as refused:
            start(None, repertoire, project=path)
        assert "\n" not in str(refused.value)
    assert path.read_bytes() == content


def test_a_project_of_a_song_elsewhere_is_refused(open_studio, repertoire, folder):
    open_studio(folder / "clicks.wav").ready().service.close()
    path = folder / "clicks.studio.json"
    data = json.loads(path.read_text())
    for song in ("../clicks.wav", "/etc/passwd", ""):
        path.write_text(json.dumps(data | {"song": song}))
        with pytest.raises((FormatError, ParameterError)):
            start(None, repertoire, project=path)


def test_a_port_is_free_or_its_user_is_told():
    with _listening("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        assert port > 0
        with pytest.raises(ChoreographError, match=f"expected port {port} of 127.0.0.1 to be free"):
            _listening("127.0.0.1", port)
    for host, other, said in (
        ("no.such.invalid", 0, "host"), ("a" * 300, 0, "host"), ("127.0.0.1", 70_000, "0 to 65535"),
    ):  # fmt: skip
        with pytest.raises(ParameterError, match=said):
            _listening(host, other)


def test_a_studio_that_cannot_be_served_is_closed(repertoire, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    service, addresses = start(None, repertoire), []
    with pytest.raises(ParameterError):
        serve(service, "127.0.0.1", 70_000, opened=False, ready=addresses.append)
    assert addresses == [] and not service.scratch.exists()
