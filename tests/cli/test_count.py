"""`choreograph count` as a user meets it."""

import json

from command_line import assert_one_line, run
from synthetic_motions import stepping

import choreograph as cg
from choreograph.formats.register import save_motion


def test_a_song_is_described_and_its_counts_are_written(tmp_path):
    song, labels = cg.example_songs()["waltz"], tmp_path / "waltz.txt"
    result = run("count", song, "-o", labels)
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0] == "waltz: 43.8 s, a song at 90.0 BPM, 3 counts in a bar"
    assert lines[1].startswith("counts: 66, 0.26 s to 43.55 s, tracked in the song, confidence ")
    assert lines[2].startswith("count 1: 0.26, 2.25, 4.26")
    assert any(line.startswith("loop of 8 bars: ") for line in lines)
    assert any(line.startswith("phrase A: 0.26 s to 8.26 s, 12 counts") for line in lines)
    assert lines[-1] == f"{labels}: 66 counts"
    assert labels.read_text().count("\n") == 66 + sum(line.startswith("phrase") for line in lines)


def test_a_motion_is_described_as_json(tmp_path):
    save_motion(tmp_path / "steps.bvh", stepping(20 * 30, period_s=0.5))
    (tmp_path / "steps.counts.csv").write_text("time_s,number\n1,1\n1.5,2\n2,1\n2.5,2\n3,1\n")
    result = run("count", tmp_path / "steps.bvh", "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert (facts["kind"], facts["tempo_bpm"], facts["metre"]) == ("motion", 120.0, 2)
    assert [loop["n_counts"] for loop in facts["loops"]] == [2, 4]
    text = run("count", tmp_path / "steps.bvh").stdout
    assert "stated beside the file" in text and "cm apart" in text


def test_errors_are_one_line(tmp_path):
    assert_one_line(run("count", tmp_path / "none.mp3"), says="there is no such file")
    song = cg.example_songs()["waltz"]
    assert_one_line(run("count", song, "-o", tmp_path / "a.mid"), says="expected a name ending in .csv")
    assert not list(tmp_path.iterdir())
