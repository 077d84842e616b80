"""Manifests as spreadsheets, editors and people write them: none is refused, and their cells are read."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acceptance.corpus import SaneFile, assert_read
from synthetic_motions import swaying

from choreograph.formats.register import import_takes, save_motion

WALTZ = {"genre": "waltz"}
ALL = {"genre": "waltz", "performer": "Zoë", "licence": "CC BY 4.0", "source": "home", "audio_offset_s": 1.5}
_HEADER = "name,genre,performer,licence,source,audio_offset_s"
_TABLE = f"{_HEADER}\nwalk,waltz,Zoë,CC BY 4.0,home,1.5\nturn,rumba,,,,\n"
_GERMAN = _TABLE.replace(",", ";").replace("1.5", "1,5")
_TABS = _TABLE.replace(",", "\t")


@dataclass(frozen=True)
class Sane:
    """A manifest, what it says of the take `walk`, and the files beside it."""

    name: str
    text: str
    says: dict[str, Any] = field(default_factory=lambda: WALTZ)
    encoding: str = "utf-8"
    file_name: str = "manifest.csv"
    take: str = "walk"  # the file of the take, without its suffix
    suffix: str = ".bvh"

    def write(self, folder: Path) -> Path:
        """Write the manifest, two takes, songs and counts."""
        (folder / "songs").mkdir()
        for song in ("tune.wav", "songs/tune 2.mp3"):
            (folder / song).touch()
        (folder / "numbers.csv").write_text("time_s,number\n0.1,1\n0.3,2\n")
        save_motion(folder / f"{self.take}{self.suffix}", MOTION)
        save_motion(folder / "turn.bvh", MOTION)
        (folder / self.file_name).write_bytes(self.text.encode(self.encoding))
        return folder


MOTION = swaying(15)
MANIFESTS = (
    Sane("commas", _TABLE, ALL),
    Sane("semicolons", _TABLE.replace(",", ";"), ALL),
    Sane("tabs", _TABS, ALL),
    Sane("semicolons-and-decimal-comma", _GERMAN, ALL),
    Sane("tabs-and-decimal-comma", _TABS.replace("1.5", "1,5"), ALL),
    Sane("commas-and-quoted-decimal-comma", 'name,genre,audio_offset_s\nwalk,waltz,"1,5"\n',
         {**WALTZ, "audio_offset_s": 1.5}),
    Sane("byte-order-mark", _TABLE, ALL, encoding="utf-8-sig"),
    Sane("byte-order-mark-and-semicolons", _GERMAN, ALL, encoding="utf-8-sig"),
    Sane("utf-16-of-excel", _TABS.replace("\n", "\r\n"), ALL, encoding="utf-16"),
    Sane("utf-16-big-endian", "\ufeff" + _TABLE, ALL, encoding="utf-16-be"),
    Sane("windows-1252", _GERMAN, ALL, encoding="cp1252"),
    Sane("windows-line-ends", _TABLE.replace("\n", "\r\n"), ALL),
    Sane("mac-line-ends", _TABLE.replace("\n", "\r"), ALL),
    Sane("no-last-line-end", _TABLE.rstrip(), ALL),
    Sane("blank-rows", _TABLE.replace("\n", "\n\n"), ALL),
    Sane("rows-of-separators", _TABLE.replace("\n", "\n,,,,,\n"), ALL),
    Sane("rows-of-semicolons-at-the-end", _GERMAN + ";;;;;\n" * 40, ALL),
    Sane("rows-of-spaces", _TABLE.replace("\n", "\n  \n"), ALL),
    Sane("blank-rows-before-the-header", "\n,,,,,\n" + _TABLE, ALL),
    Sane("trailing-commas", _TABLE.replace("\n", ",,,\n"), ALL),
    Sane("trailing-semicolons", _GERMAN.replace("\n", ";;\n"), ALL),
    Sane("trailing-commas-in-rows-alone", "name,genre\nwalk,waltz,,\nturn,rumba,,,\n"),
    Sane("trailing-commas-in-the-header-alone", "name,genre,,\nwalk,waltz\n"),
    Sane("capitals", _TABLE.replace(_HEADER, _HEADER.upper()), ALL),
    Sane("title-case", _TABLE.replace(_HEADER, _HEADER.title()), ALL),
    Sane("license", _TABLE.replace("licence", "license"), ALL),
    Sane("License-and-semicolons", _GERMAN.replace("licence", "License"), ALL),
    Sane("spaces-in-column-names", _TABLE.replace("audio_offset_s", "Audio offset s"), ALL),
    Sane("hyphens-in-column-names", _TABLE.replace("audio_offset_s", "audio-offset-s"), ALL),
    Sane("spaces-around-cells", _TABLE.replace(",", " , "), ALL),
    Sane("spaces-that-do-not-break", _TABLE.replace(",", "\u00a0,\u00a0"), ALL),
    Sane("all-cells-quoted", "".join(
        ",".join(f'"{cell}"' for cell in line.split(",")) + "\n" for line in _TABLE.splitlines()), ALL),
    Sane("quoted-comma", 'name,genre,source\nwalk,waltz,"home, sweet"\n', {**WALTZ, "source": "home, sweet"}),
    Sane("quoted-line-end", 'name,source,genre\nwalk,"home,\nsweet",waltz\n',
         {**WALTZ, "source": "home,\nsweet"}),
    Sane("doubled-quotes", 'name,genre,performer\nwalk,waltz,"the ""Ada"""\n',
         {**WALTZ, "performer": 'the "Ada"'}),
    Sane("separator-of-excel", "sep=;\r\n" + _GERMAN, ALL),
    Sane("names-of-files", "name,genre\nwalk.bvh,waltz\nturn.bvh,rumba\n"),
    Sane("names-of-files-in-capitals", "name,genre\nwalk.BVH,waltz\n"),
    Sane("glb", "name,genre\nwalk.glb,waltz\n", suffix=".glb"),
    Sane("npz", "name,genre\nwalk.npz,waltz\n", suffix=".npz"),
    Sane("names-alone", "name\nwalk\nturn\n", {}),
    Sane("header-alone", _HEADER + "\n", {}),
    Sane("other-order", "genre,source,name\nwaltz,home,walk\n", {**WALTZ, "source": "home"}),
    Sane("shared-song", "name,song\nwalk,tune.wav\nturn,tune.wav\n", {"song": "tune.wav"}),
    Sane("song-in-a-folder", "name;song\nwalk;songs/tune 2.mp3\n", {"song": "tune 2.mp3"}),
    Sane("counts", "name,counts,genre\nwalk,numbers.csv,waltz\n", {**WALTZ, "counts": [0.1, 0.3]}),
    Sane("beats", "name,beats\nwalk,0.1 0.3\n", {"counts": [0.1, 0.3]}),
    Sane("beats-with-decimal-commas", "name;beats\nwalk;0,1 0,3\n", {"counts": [0.1, 0.3]}),
    Sane("blank-column-between", "name,,genre\nwalk,,waltz\n"),
    Sane("blank-first-column", ",name,genre\n,walk,waltz\n"),
    Sane("file-name-in-capitals", _TABLE, ALL, file_name="MANIFEST.CSV"),
    Sane("negative-offset", "name,audio_offset_s\nwalk,-0.25\n", {"audio_offset_s": -0.25}),
    Sane("whole-offset", "name;audio_offset_s\nwalk;2\n", {"audio_offset_s": 2.0}),
    Sane("name-with-spaces", "name,genre\nWalk on 2,waltz\n", take="Walk on 2"),
    Sane("name-with-a-dot", "name,genre\nwalk.take2,waltz\n", take="walk.take2"),
    Sane("name-in-another-script", "name,genre\n歩く,waltz\n", take="歩く"),
)  # fmt: skip


FILES = [SaneFile(manifest.name, manifest.write) for manifest in MANIFESTS]


def read_manifest(folder: Path) -> None:
    """Read the takes of a folder, and assert that the first has what its manifest says."""
    manifest = next(manifest for manifest in MANIFESTS if manifest.name == folder.name)
    takes = {take.name: take for take in import_takes(folder)}
    assert sorted(takes) == sorted((manifest.take, "turn"))
    take = takes[manifest.take]
    read: dict[str, Any] = {
        "audio_offset_s": take.song_start_s,
        "song": take.song_path.name if take.song_path else "",
        "counts": take.counts.times_s.tolist(),
    }
    for column in ("genre", "performer", "licence", "source"):
        read[column] = getattr(take.credits, column)
    empty = {"audio_offset_s": 0.0, "song": "", "counts": []}
    said = {**dict.fromkeys(read, ""), **empty, **manifest.says}
    assert read == said, manifest.name


def test_sane_manifests_are_read(tmp_path):
    """None of them is refused: 1 % of as many is none."""
    assert_read(FILES, read_manifest, tmp_path, n_files=40)
