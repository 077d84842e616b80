"""The service: news for every page, work that is done once, and a state that is JSON."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from synthetic_characters import CHARACTERS, write_character

from choreograph.characters.character import read_character
from choreograph.core.errors import FormatError, ParameterError
from choreograph.studio.refusals import NotFoundError
from choreograph.studio.server import start
from choreograph.studio.service import News, Service, scratch_folder


@pytest.fixture
def service(repertoire, tmp_path):
    """A studio without a song."""
    made = Service(tmp_path, repertoire)
    yield made
    made.close()


def test_news_reach_all_that_listen_in_order():
    async def listened():
        news = News()
        streams = [news.stream(), news.stream()]
        assert [await anext(stream) for stream in streams] == [": welcome\n\n"] * 2
        await asyncio.to_thread(lambda: [news.tell({"state": i}) for i in range(3)])
        heard = [[await anext(stream) for _ in range(3)] for stream in streams]
        await streams[0].aclose()
        news.tell({"state": 3})
        heard.append([await anext(streams[1])])
        await streams[1].aclose()
        return heard, news._listeners

    heard, left = asyncio.run(listened())
    told = [f'data: {{"state": {i}}}\n\n' for i in range(4)]
    assert heard == [told[:3], told[:3], told[3:]] and left == []


def test_a_silent_stream_gives_signs_of_life():
    async def listened():
        stream = News(beat_s=0.01).stream()
        heard = [await anext(stream) for _ in range(3)]
        await stream.aclose()
        return heard

    assert asyncio.run(listened())[1:] == [": alive\n\n"] * 2


def test_news_to_a_page_that_has_gone_are_dropped():
    news = News()

    async def opened():
        stream = news.stream()
        await anext(stream)
        return stream

    loop = asyncio.new_event_loop()
    stream = loop.run_until_complete(opened())
    loop.close()
    news.tell({"state": 1})  # the loop of the page is closed
    assert stream is not None


def test_a_change_is_told_with_its_revision(service, monkeypatch):
    told = []
    monkeypatch.setattr(service.news, "tell", told.append)
    state = service.change_now("nothing", lambda job: "not shown")
    assert {"state": state["revision"]} in told
    job = service.change("nothing", lambda job: "not shown")
    assert job.ended.wait(10) and job.result == {"revision": state["revision"]}
    assert all(one["job"]["result"] is None for one in told if "job" in one)


def test_a_failed_change_is_not_told_as_a_state(service, monkeypatch):
    told = []
    monkeypatch.setattr(service.news, "tell", told.append)

    def fail(job):
        raise ParameterError("expected a, got b")

    with pytest.raises(ParameterError, match="expected a, got b"):
        service.change_now("fault", fail)
    with pytest.raises(ParameterError):
        asyncio.run(service.soon("fault", fail))
    assert not any("state" in one for one in told)


def test_the_state_is_json_with_and_without_a_dance(service, client):
    for one in (service, client.service):
        state = one.state()
        assert json.loads(json.dumps(state, allow_nan=False)) == state
    assert service.state()["dance"] is None and client.service.state()["dance"]["blocks"]
    assert set(service.state()) == set(client.service.state())


def test_without_a_song_there_is_no_sound(service):
    with pytest.raises(NotFoundError):
        service.sound()


def test_the_song_is_encoded_once(client, monkeypatch):
    first = client.service.sound()
    monkeypatch.setattr("choreograph.studio.service.encode_mp4", None)  # a call would fail
    assert client.service.sound() is first and first.path.stat().st_size > 1000


def test_the_palette_is_measured_once_for_each_repertoire(service, monkeypatch):
    first = service.palette()
    assert service.palette() is first and first.parts
    other = Service(service.studio.folder, service.studio.state.repertoire)
    assert other.palette() is not first
    other.close()
    known = service.studio.state
    again = known.repertoire.open(known.repertoire.path)
    monkeypatch.setattr(service.studio, "state", replace(known, repertoire=again))
    assert service.palette() is not first


def test_a_character_of_another_folder_is_not_in_the_project(client, folder, tmp_path_factory):
    service = client.service
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "hero.glb"
    for path, noted in ((elsewhere, ""), (folder / "hero.glb", "hero.glb")):
        write_character(path, CHARACTERS["mixamo"])
        service.use_character(read_character(path))
        assert (
            service.studio.project.character == noted and service.state()["character"]["name"] == "hero.glb"
        )
    service.character = None
    service.restore_character()
    assert service.state()["character"]["name"] == "hero.glb"
    service.character = None
    (folder / "hero.glb").write_bytes(b"no character")
    with pytest.raises(FormatError):
        service.restore_character()
    (folder / "hero.glb").unlink()
    service.restore_character()
    assert service.character is None


def test_a_closed_service_leaves_nothing(repertoire, folder):
    service = start(folder / "clicks.wav", repertoire)
    scratch = service.scratch
    assert scratch.is_dir()
    service.close()
    assert not scratch.exists() and not list(folder.glob(".*lock"))


def test_what_killed_studios_left_is_removed_but_not_what_running_ones_use(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code = """
import os
from choreograph.studio.service import scratch_folder
held = scratch_folder()
folder = held.__enter__()
(folder / "sent-1").mkdir()
(folder / "sent-1" / "song.wav").write_bytes(b"1")
print(folder, flush=True)
input()
os._exit(1)
"""
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    command = [sys.executable, "-c", code]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        other = Path(process.stdout.readline().strip())
        os.utime(other / "lock", (1, 1))  # as if it ran for long
        with scratch_folder() as mine:
            assert {*tmp_path.iterdir()} == {mine, other} and (other / "sent-1" / "song.wav").exists()
        process.communicate("\n")
    with scratch_folder() as mine:
        assert list(tmp_path.iterdir()) == [mine]
    assert list(tmp_path.iterdir()) == []
