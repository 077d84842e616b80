"""The page file: self-contained, small, deterministic, and an error for wrong input."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from synthetic_motions import swaying
from synthetic_pages import TAKES, plan_for, write_seconds

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.view.page import write_page

MOTION = swaying(330, fps=60.0)
PLAN = plan_for(MOTION)


def written(path, motion=MOTION, plan=PLAN, *, song_path=None, motion_beats_s=(0.5, 1.5), **options) -> str:
    write_page(path, motion, plan, song_path=song_path, motion_beats_s=motion_beats_s, **options)
    return path.read_text(encoding="utf-8")


def element(text: str, name: str) -> str:
    return re.search(rf'<script type="[a-z/]+" id="{name}">(.*?)</script>', text, re.DOTALL).group(1)


@pytest.fixture(scope="module")
def song(tmp_path_factory):
    return write_seconds(tmp_path_factory.mktemp("song") / "song.wav", duration_s=6.0)


def test_nothing_is_fetched(tmp_path, song):
    text = written(tmp_path / "page.html", song_path=song)
    code = text.replace(element(text, "sound"), "").replace(element(text, "motion"), "")
    assert not re.findall(r"""(?:https?:)?//[a-z0-9-]+\.[a-z]|\bimport\b|url\(|fetch\(|XMLHttp""", code)
    assert re.findall(r"""\s(?:src|href)\s*=\s*["']?([^"'\s>]*)""", code) == ["data:,"]
    assert "default-src 'none'" in text
    assert "@@" not in code


def test_data_of_the_timeline(tmp_path, song):
    dance = json.loads(element(written(tmp_path / "page.html", song_path=song, title="A & B"), "dance"))
    assert dance["title"] == "A & B"
    assert dance["duration_s"] == 5.5
    assert dance["music_beats_s"] == list(np.arange(0, 5.5, 0.5))
    assert dance["motion_beats_s"] == [0.5, 1.5]
    assert [take["name"] for take in dance["takes"]] == sorted(TAKES)
    assert len(dance["blocks"]) == 6
    fourth = dance["blocks"][3]
    assert dance["takes"][fourth["take"]]["name"] == "ben-house"
    assert dance["takes"][fourth["take"]]["performer"] == "dancer of ben-house"
    assert (fourth["clip"], fourth["from_s"], fourth["to_s"]) == (41, 15.25, 16.5)
    assert fourth["costs"] == {"style": 0.28, "transition": 0.0}


def test_a_part_of_the_dance(tmp_path, song):
    text = written(tmp_path / "page.html", song_path=song, duration_s=2.5, motion_beats_s=[0.5, 2.0, 3.0])
    dance = json.loads(element(text, "dance"))
    assert (dance["duration_s"], len(dance["blocks"]), dance["motion_beats_s"]) == (2.5, 3, [0.5, 2.0])
    assert {take["name"] for take in dance["takes"]} == {"anna-waltz", "ben-house"}
    assert len(element(text, "sound")) < len(element(written(tmp_path / "all.html", song_path=song), "sound"))


def test_counts_are_those_of_the_beats_shown(tmp_path):
    assert json.loads(element(written(tmp_path / "old.html"), "dance"))["music_beat_numbers"] == []
    counted = replace(PLAN, music_beat_numbers=(3, 1, 2, 3, 1, 2, 3, 1, 2, 3, 1), metre=3)
    text = written(tmp_path / "page.html", plan=counted, duration_s=2.2)
    dance = json.loads(element(text, "dance"))
    assert dance["metre"] == 3
    assert dance["music_beats_s"] == [0, 0.5, 1.0, 1.5, 2.0]
    assert dance["music_beat_numbers"] == [3, 1, 2, 3, 1]


def test_same_dance_gives_the_same_bytes(tmp_path, song):
    assert written(tmp_path / "a.html", song_path=song) == written(tmp_path / "b.html", song_path=song)


def test_four_minutes_fit_in_three_megabytes(tmp_path):
    motion = swaying(14_400, fps=60.0)
    beats_s = np.arange(0.0, 240.0, 0.4)
    text = written(tmp_path / "page.html", motion, plan_for(motion), motion_beats_s=beats_s)
    assert len(text.encode()) < 3_000_000
    assert json.loads(element(text, "dance"))["fps"] == 60.0


def test_names_cannot_break_out_of_the_page(tmp_path):
    evil = "</script><script>alert(1)</script>"
    plan = replace(plan_for(MOTION, takes=(evil, "<!--", "b\u2028")), song=evil)
    text = written(tmp_path / "page.html", MOTION, plan)
    assert "<script>alert" not in text
    assert json.loads(element(text, "dance"))["takes"][1]["name"] == evil


def test_no_song_no_sound(tmp_path):
    assert element(written(tmp_path / "page.html"), "sound") == ""


def test_scripts_share_one_scope(tmp_path):
    """The modules are bundled in one script: a top-level name defined by two of them would break the page."""
    script = written(tmp_path / "page.html").split('<script type="module">')[1]
    names = re.findall(r"^(?:async )?(?:const|let|class|function) (\w+)", script, re.MULTILINE)
    assert len(names) > 50
    assert sorted(names) == sorted(set(names))


@pytest.mark.parametrize(
    ("options", "kind"),
    [
        ({"motion_beats_s": [2.0, 1.0]}, ParameterError),
        ({"motion_beats_s": [np.nan]}, ParameterError),
        ({"motion_beats_s": [[1.0]]}, ParameterError),
        ({"duration_s": 0.0}, ParameterError),
        ({"duration_s": 9.0}, ParameterError),
        ({"duration_s": np.nan}, ParameterError),
        ({"plan": plan_for(swaying(600, fps=60.0))}, ParameterError),
        ({"song_path": "no such song.mp3"}, FormatError),
        ({"start_s": -1.0, "song_path": "no such song.mp3"}, ParameterError),
    ],
)
def test_wrong_input_is_a_one_line_error_and_leaves_no_file(tmp_path, options, kind):
    with pytest.raises(kind) as refused:
        written(tmp_path / "page.html", **options)
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_missing_folder(tmp_path):
    with pytest.raises(ChoreographError):
        written(tmp_path / "nowhere" / "page.html")
