"""The files of a rating study: blinded, self-contained, ordered by the seed; malformed input is refused."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from synthetic_motions import swaying
from synthetic_studies import VARIANTS, read_key, small_study

from choreograph.core.errors import FormatError, ParameterError
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from research.study.writing import QUESTIONS, StudyDance, write_study


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    return small_study(tmp_path_factory.mktemp("study"))


@pytest.fixture(scope="module")
def page(study) -> str:
    return (study / "study.html").read_text(encoding="utf-8")


def data_of(page: str) -> dict:
    return json.loads(re.search(r'id="study">(.*?)</script>', page, re.DOTALL).group(1))


def code_of(page: str) -> str:
    """The page without compressed bytes."""
    return re.sub(r'(<script type="text/plain"[^>]*>)[^<]*', r"\1", page)


def test_the_page_is_blinded(study, page):
    assert sorted(path.name for path in study.iterdir()) == ["key.json", "study.html"]
    for word in (*VARIANTS, "xvariant", "tune-", '.wav"', str(study.parent)):
        assert word not in page
    assert set(data_of(page)["dances"][0]) == {
        "id", "duration_s", "frames", "root_step_m", "root_origin_m", "sound"
    }  # fmt: skip
    key = read_key(study)
    assert "keep this file from the raters" in key["note"]
    listed = [(dance["variant"], dance["song"]) for dance in key["dances"]]
    assert sorted(listed) == sorted((v, f"tune-{n}.wav") for v in VARIANTS for n in range(3))


def test_rate_and_length_do_not_reveal_the_variant(page):
    dances = data_of(page)["dances"]
    assert data_of(page)["body"]["fps"] == 60.0
    assert len({dance["frames"] for dance in dances}) == 1  # though recorded at 60 and at 30 fps


def test_the_body_does_not_reveal_the_variant(tmp_path):
    motion = swaying(60, fps=60.0)
    scaled = Skeleton(motion.skeleton.names, motion.skeleton.parents, 1.2 * motion.skeleton.offsets_m)
    taller = Motion(scaled, 1.2 * motion.root_pos_m, motion.local_quat, 60.0)
    song = Path("never read.wav")
    dances = {"a": [StudyDance(taller, song)], "b": [StudyDance(motion, song)]}
    write_study(dances, tmp_path / "study", seed=0, sound=False)
    body = data_of((tmp_path / "study" / "study.html").read_text(encoding="utf-8"))["body"]
    np.testing.assert_allclose(body["offsets_m"], motion.skeleton.offsets_m, atol=1e-6)


def test_nothing_is_fetched(page):
    code = code_of(page)
    assert not re.findall(r"""(?:https?:)?//[a-z0-9-]+\.[a-z]|\bimport\b|url\(|fetch\(|XMLHttp""", code)
    assert re.findall(r"""\s(?:src|href)\s*=\s*["']([^"'\s>]*)""", code) == ["data:,"]
    assert "default-src 'none'" in code and "@@" not in code


def test_scripts_share_one_scope(page):
    script = page.split('<script type="module">')[1]
    names = re.findall(r"^(?:async )?(?:const|let|class|function) (\w+)", script, re.MULTILINE)
    assert len(names) > 40
    assert sorted(names) == sorted(set(names))


def test_a_song_is_stored_once_and_dances_refer_to_it(study, page):
    assert len(re.findall(r'id="sound-\d+"', page)) == 3
    sounds = {
        (dance["sound"], entry["song"])
        for dance, entry in zip(data_of(page)["dances"], read_key(study)["dances"], strict=True)
    }
    assert len(sounds) == 3


def test_the_seed_decides_the_order(tmp_path, study):
    again, other = (small_study(tmp_path, seed=seed) for seed in (3, 4))
    for name in ("study.html", "key.json"):
        assert (again / name).read_bytes() == (study / name).read_bytes()
    orders = [[(d["variant"], d["song"]) for d in read_key(s)["dances"]] for s in (again, other)]
    assert orders[0] != orders[1] and sorted(orders[0]) == sorted(orders[1])
    for order in orders:
        assert all(here[1] != after[1] for here, after in pairwise(order))


def test_without_sound_there_are_two_questions(tmp_path):
    study = small_study(tmp_path, sound=False)
    page = (study / "study.html").read_text(encoding="utf-8")
    assert 'id="sound-' not in page
    silent = [question.id for question in QUESTIONS if not question.needs_sound]
    assert (
        [question["id"] for question in data_of(page)["questions"]] == silent == read_key(study)["questions"]
    )
    assert len(silent) == 2
    assert all(dance["sound"] is None for dance in data_of(page)["dances"])


def test_pairs_are_of_two_variants_to_one_song_on_either_side(tmp_path):
    study = small_study(tmp_path, n_songs=4, ask="pairs", sound=False)
    page = (study / "study.html").read_text(encoding="utf-8")
    data, key = data_of(page), read_key(study)
    assert data["questions"] == [] == key["questions"]
    assert not any(word in page for word in VARIANTS)
    entries = {dance["dance"]: dance for dance in key["dances"]}
    sides = [[entries[name] for name in pair["dances"]] for pair in key["pairs"]]
    assert len(sides) == 4 * 3
    assert all(a["song"] == b["song"] and a["variant"] != b["variant"] for a, b in sides)
    assert {a["variant"] for a, _ in sides} == {b["variant"] for _, b in sides} == set(VARIANTS)
    by_id = {pair["id"]: pair for pair in data["pairs"]}
    for pair, (dance, _) in zip(key["pairs"], sides, strict=True):
        texts = [question["text"] for question in by_id[pair["pair"]]["questions"]]
        assert by_id[pair["pair"]]["dances"] == pair["dances"]
        asks_genre = dance["song"] == "tune-0.wav"  # the only one whose genre is known
        assert pair["questions"] == (["genre", "computer"] if asks_genre else ["computer"])
        assert ("Which is more waltz?" in texts) == asks_genre


def test_ratings_and_pairs_can_be_asked_in_one_study(tmp_path):
    study = small_study(tmp_path, ask="both")
    data = data_of((study / "study.html").read_text(encoding="utf-8"))
    assert len(data["questions"]) == 4 and len(data["pairs"]) == 9 and len(data["dances"]) == 9


def test_an_excerpt_is_the_middle(tmp_path):
    study = small_study(tmp_path, duration_s=3.0, excerpt_s=1.0)
    page = (study / "study.html").read_text(encoding="utf-8")
    assert {dance["frames"] for dance in data_of(page)["dances"]} == {60}
    assert all(dance["start_s"] == pytest.approx(1.0, abs=0.02) for dance in read_key(study)["dances"])


def test_several_dances_of_a_variant_to_a_song_are_numbered_as_given(tmp_path):
    song = Path("never read.wav")
    starts = {60: 0.0, 66: 10.0, 72: 20.0}
    dances = {v: [StudyDance(swaying(n, fps=60.0), song, s) for n, s in starts.items()] for v in "ab"}
    write_study(dances, tmp_path / "study", seed=5, sound=False)
    frames = data_of((tmp_path / "study" / "study.html").read_text(encoding="utf-8"))["dances"]
    numbers = {
        (entry["number"], shown["frames"])
        for entry, shown in zip(read_key(tmp_path / "study")["dances"], frames, strict=True)
    }
    assert numbers == {(0, 60), (1, 66), (2, 72)}


DANCE = StudyDance(swaying(60, fps=60.0), Path("no such song.wav"))


@pytest.mark.parametrize(
    ("dances", "options", "kind"),
    [
        ({}, {}, ParameterError),
        ({"a": []}, {}, ParameterError),
        ({"a": [DANCE]}, {"seed": -1}, ParameterError),
        ({"a": [DANCE]}, {"seed": 1.5}, ParameterError),
        ({"a": [DANCE]}, {"excerpt_s": 0.5}, ParameterError),
        ({"a": [DANCE]}, {"ask": "pairs"}, ParameterError),
        ({"a": [DANCE]}, {"ask": "nothing"}, ParameterError),
        ({"a": [DANCE]}, {"excerpt_s": np.nan}, ParameterError),
        ({"a": [DANCE]}, {}, FormatError),
    ],
)
def test_malformed_input_is_refused_in_a_line_and_writes_nothing(tmp_path, dances, options, kind):
    with pytest.raises(kind) as refused:
        write_study(dances, tmp_path / "study", **{"seed": 0, **options})
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_study_is_not_overwritten(tmp_path):
    study = small_study(tmp_path)
    before = (study / "key.json").read_bytes()
    with pytest.raises(ParameterError, match="without a study"):
        small_study(tmp_path)
    assert (study / "key.json").read_bytes() == before
    with pytest.raises(ParameterError, match="parent"):
        write_study({"a": [DANCE]}, tmp_path / "no" / "where", seed=0, sound=False)
