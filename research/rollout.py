"""The rollout network with motifs: ablations, genres, recreated dances, variations, style and feet.

    python research/rollout.py SONGS REPERTOIRE… [--only NAMES] [--beats FOLDER] [--ablations FOLDER]

SONGS are dance-with-melody, with repertoires built with `--rollout` and `--leave-out
@research/dance_with_melody_held_out.txt`. They are the held-out songs and those without motion. Or SONGS are
takes that `unseen_starter_takes.py` made, with repertoires of `python -m content.starter --seed N`, and NAMES
and FOLDER are those of its docstring. Up to 80 s of each song are danced with its genre given.

Each repertoire has its own seed. Numbers are mean ± spread over repertoires. The χ² of a repertoire is also
measured by the word network of the next one ("chi2 judged"), which was used neither to choose its motifs nor
to train it. The FOLDER of the ablations was written by `train_rollout_ablations.py`. A repertoire without
any network to measure is a judge only. "landed" is the finished
rollout, warped so that its accents lie on the beats. "read" are counts that a network estimates from the
motion alone. "by genre" is Table 1 of the paper: χ² to the signature of the genre, with intervals over
repertoires.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
import torch
from scipy.stats import t
from swapped_net import NetsByGenre, WithNet, ablated_nets, bounds_of

import choreograph as cg
from choreograph.choreography.enforcement import danced_motifs
from choreograph.choreography.rollout import generation
from choreograph.core.numerics import chi_square_distance
from choreograph.evaluation.dance_scores import read_count_scores
from choreograph.evaluation.metrics import beat
from choreograph.evaluation.metrics.beat import beats_by_detector, detector_scores, our_beats_s
from choreograph.evaluation.metrics.physical import foot_slide_cm_s, joint_jerk_m_s3
from choreograph.evaluation.songs import SongMusic, find_songs, song_music
from choreograph.library.schema import rollout_names
from choreograph.library.vocabulary import dance_bounds_s, signature
from choreograph.motion.body import body_pos_m, to_root_frame
from choreograph.motion.motion import Motion, Take
from choreograph.music.beats import DEFAULT_TRACKER
from choreograph.music.count_grids import accent_shifts_s
from choreograph.music.song import Song, load_song
from choreograph.nets.rollout_poses import PosePredictor
from choreograph.pipeline.published import published_dance

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
WITHOUT_MOTION = {"DANCE_C_1": "cha-cha", "DANCE_C_3": "cha-cha", "DANCE_R_6": "rumba", "DANCE_R_10": "rumba"}
MAX_SONG_S = 80.0
STILL_M_S = 0.15
TITLES = ("ablations", "re-created", "variations", "style", "feet", "long")

Row = dict[str, float]
Table = dict[str, Row]  # a row by name


@dataclass(frozen=True, eq=False)
class Piece:
    """A song to dance to, and what was danced to it if that is known."""

    name: str
    song: Song
    genre: str
    take: Take | None
    music: SongMusic  # that dances are measured against


def pieces_of(data: Path, only: Path, beats: str) -> list[Piece]:
    pieces = []
    for found in find_songs(data, only=only.read_text(encoding="utf-8").split(), duration_s=MAX_SONG_S):
        song = found.load()
        pieces.append(Piece(found.name, song, found.genre, found.take, song_music(song, beats)))
    for name, genre in WITHOUT_MOTION.items():
        if (data / name).is_dir():
            song = load_song(data / name / "audio.mp3", duration_s=MAX_SONG_S)
            pieces.append(Piece(name, song, genre, None, song_music(song, beats)))
    return pieces


def means(rows: Mapping[str, Sequence[Row]]) -> Table:
    """Each row's mean over songs."""
    return {
        name: {key: float(np.mean([r[key] for r in of_name])) for key in of_name[0]}
        for name, of_name in rows.items()
    }


def ablated(
    pieces: list[Piece], repertoire: WithNet, judge: cg.Repertoire, nets: Mapping[str, NetsByGenre]
) -> dict[str, Table]:
    """Distance to the template, beats, and speeds, for every network, and of what was really danced.

    And the distances by genre.
    """
    k = repertoire.vocabulary.n_motifs
    rows, by_genre = defaultdict(list), defaultdict(list)
    for piece in pieces:
        goal = repertoire.vocabulary.signatures[repertoire.vocabulary.genre_index(piece.genre)]
        motions: dict[str, Motion] = {}
        own = {"rollout": None} if rollout_names(repertoire.net_names) else {}
        for name, net in {**own, **nets}.items():
            repertoire.swapped = net
            config = published_dance("rollout") if name.startswith("published") else cg.DanceConfig()
            dance = cg.dance(piece.song, repertoire, engine="rollout", genre=piece.genre, config=config)
            motions[name] = dance.motion
        repertoire.swapped = None
        beats, bounds = piece.music.beats_s, bounds_of(dance)
        if "rollout" in motions:
            motions["rollout, landed"] = landed(motions["rollout"], np.array(dance.plan.music_beats_s))
        if piece.take is not None:
            motions["real"] = piece.take.motion
        asked = np.array([word.motif for word in dance.plan.words])
        for name, motion in motions.items():
            inside = bounds[bounds <= motion.duration_s + 0.04]
            danced = danced_motifs(motion, inside, repertoire)
            body = body_pos_m(motion)
            by_detector = beats_by_detector(body, motion.fps)
            kinematic = by_detector["savitzky_golay"]
            read = read_count_scores(motion, piece.music, np.random.default_rng(0)).values
            rows[name].append(
                {
                    "chi2": chi_square_distance(signature(danced[danced >= 0], k), goal),
                    "chi2 judged": judged_chi2(motion, inside, piece.genre, judge),
                    "motifs as asked": np.nan if name == "real" else np.mean(danced == asked[: len(danced)]),
                    "aligned": beat.aligned_share(kinematic, beats),
                    "ratio": beat.beat_ratio(kinematic, beats),
                    "F": detector_scores(by_detector, beats)["f_score_mean"],
                    "read": read.get("counts_read_within", np.nan),
                    "read 1": read.get("downbeat_share_read", np.nan),
                    "slide cm/s": foot_slide_cm_s(body, motion.fps),
                    "speed m/s": np.linalg.norm(np.diff(body, axis=0), axis=-1).mean() * motion.fps,
                    "jerk p95": np.percentile(joint_jerk_m_s3(body, motion.fps)[1], 95),
                }
            )
            of_genre = {key: rows[name][-1][key] for key in ("chi2 judged", "chi2")}
            by_genre[f"{piece.genre}, {name}"].append(of_genre)
    return {"ablations": means(rows), "by genre": means(by_genre)}


def landed(motion: Motion, beats_s: np.ndarray) -> Motion:
    """The motion, warped a little so that its accents lie on the beats, where they gather near them."""
    shifts_s = accent_shifts_s(our_beats_s(body_pos_m(motion), motion.fps), beats_s)
    times_s = np.arange(motion.n_frames) / motion.fps
    times_s += np.interp(times_s, beats_s, shifts_s)
    return motion.sampled_smooth(times_s.clip(0.0, motion.duration_s) * motion.fps)


def judged_chi2(motion: Motion, bounds_s: np.ndarray, genre: str, judge: cg.Repertoire) -> float:
    """Distance to the genre's template in the vocabulary of another repertoire."""
    danced = danced_motifs(motion, bounds_s, judge)
    goal = judge.vocabulary.signatures[judge.vocabulary.genre_index(genre)]
    return float(chi_square_distance(signature(danced[danced >= 0], len(goal)), goal))


def recreated(pieces: list[Piece], repertoire: WithNet, nets: Mapping[str, NetsByGenre]) -> Table:
    """Share of a held-out dance's motifs that are danced again in their order."""
    rows = defaultdict(list)
    for piece in pieces:
        if piece.take is None:
            continue
        beats = np.array(cg.dance(piece.song, repertoire, engine="rollout").plan.music_beats_s)
        bounds = dance_bounds_s(beats, piece.song.duration_s)
        asked = danced_motifs(piece.take.motion, bounds, repertoire)
        motifs = np.where(asked < 0, 0, asked).tolist()
        runs = {"rollout": ("rollout", None), "mixer": ("mixer", None)}
        runs |= {name: ("rollout", net) for name, net in nets.items()}
        for name, (engine, net) in runs.items():
            repertoire.swapped = net
            dance = cg.dance(piece.song, repertoire, engine=engine, motifs=motifs)
            danced = danced_motifs(dance.motion, bounds_of(dance), repertoire)[: len(asked)]
            rows[name].append({"motifs as asked": np.mean((danced == asked)[asked >= 0])})
    repertoire.swapped = None
    return means(rows)


def apart_cm(a: Motion, b: Motion) -> float:
    n = min(a.n_frames, b.n_frames)
    poses = (to_root_frame(body_pos_m(m)[:n]) for m in (a, b))
    return float(100 * np.linalg.norm(next(poses) - next(poses), axis=-1).mean())


def varied(pieces: list[Piece], repertoire: WithNet) -> Table:
    """Three runs of a song and template: how far apart, the nearest two, and how near to the template."""
    rows = []
    for piece in pieces:
        goal = repertoire.vocabulary.signatures[repertoire.vocabulary.genre_index(piece.genre)]
        dances = cg.vary(piece.song, repertoire, 3, engine="rollout", genre=piece.genre)
        apart = [apart_cm(dances[i].motion, dances[j].motion) for i, j in ((0, 1), (0, 2), (1, 2))]
        motifs = [danced_motifs(dance.motion, bounds_of(dance), repertoire) for dance in dances]
        far = [chi_square_distance(signature(m[m >= 0], len(goal)), goal) for m in motifs]
        rows.append({"apart cm": np.mean(apart), "nearest cm": np.min(apart), "chi2": np.mean(far)})
    return means({"three runs": rows})


def styled(pieces: list[Piece], repertoire: WithNet) -> Table:
    """The song's style against another's, and noise: ours, with the paper's window, and with its β, too."""
    settings = {
        "ours": {}, "the paper's window": {"style_window": "hamming"},
        "the paper's window and β": {"style_window": "hamming", "style_strength": 40.0},
    }  # fmt: skip
    net = repertoire.rollout_net()
    rows = defaultdict(list)
    for title, given in settings.items():
        for piece, other in zip(pieces, pieces[1:] + pieces[:1], strict=True):
            asked = {"genre": piece.genre, "engine": "rollout", **given}
            own = cg.dance(piece.song, repertoire, **asked)
            motifs = danced_motifs(own.motion, bounds_of(own), repertoire)
            dances = {"another song": cg.dance(piece.song, repertoire, **asked, style_song=other.song)}
            with patch.object(generation, "word_spectra", partial(noise, net)):
                dances["noise"] = cg.dance(piece.song, repertoire, **asked, cache=False)
            for name, dance in dances.items():
                same = danced_motifs(dance.motion, bounds_of(dance), repertoire) == motifs
                kept = beat.f_score(dance.motion_beats_s, own.motion_beats_s, window_s=beat.FRAME_S)
                rows[f"{name}, {title}"].append(
                    {"apart cm": apart_cm(dance.motion, own.motion), "motifs kept": same.mean(),
                     "beats kept": kept}
                )  # fmt: skip
    return means(rows)


def noise(net: PosePredictor, song: Song, bounds_s: np.ndarray) -> np.ndarray:
    """In the place of spectral features: numbers of the same spread that mean nothing."""
    mean, std = net.weights["spectral_mean"], net.weights["spectral_std"]
    return np.random.default_rng(0).normal(mean, std, (len(bounds_s) - 1, len(mean)))


def long_dances(pieces: list[Piece], repertoire: WithNet) -> Table:
    """Three minutes, the song over and over, by thirds: speed, spread of poses, and how far it goes."""
    rows = []
    for piece in (pieces[0], pieces[3], pieces[-1]):
        times = int(np.ceil(180.0 / piece.song.duration_s))
        song = replace(piece.song, samples=np.tile(piece.song.samples, times)[: 180 * 22050])
        motion = cg.dance(song, repertoire, engine="rollout", genre=piece.genre).motion
        body = body_pos_m(motion)
        speed = np.linalg.norm(np.diff(body, axis=0), axis=-1).mean(axis=1) * motion.fps
        row = {f"m/s, third {i}": part.mean() for i, part in enumerate(np.array_split(speed, 3), 1)}
        for i, part in enumerate(np.array_split(body, 3), 1):
            row[f"spread cm, third {i}"] = to_root_frame(part).std(axis=0).mean() * 100
        row["farthest m"] = np.linalg.norm(motion.root_pos_m[:, [0, 2]], axis=1).max()
        row["still"] = np.mean([part.max() < STILL_M_S for part in np.array_split(speed, 180)])
        rows.append(row)
    return means({"three minutes": rows})


def feet(pieces: list[Piece], repertoire: WithNet) -> Table:
    """Slide of low feet with and without holding them, and of real takes, cm/s."""
    rows = []
    for piece in pieces:
        if piece.take is None:
            continue
        held = cg.dance(piece.song, repertoire, engine="rollout", genre=piece.genre).motion
        with patch.object(generation, "lock_feet", lambda motion, *contacts, **settings: motion):
            free = cg.dance(piece.song, repertoire, engine="rollout", genre=piece.genre).motion
        motions = {"held": held, "not held": free, "real": piece.take.motion}
        rows.append({name: foot_slide_cm_s(body_pos_m(m), m.fps) for name, m in motions.items()})
    return means({"slide cm/s": rows})


def show(title: str, tables: Sequence[Table]) -> None:
    """Mean ± spread over repertoires and half of its 95 % interval. A row may be of some of them only."""
    print(f"{title}, {len(tables)} repertoires")
    for name in dict.fromkeys(name for table in tables for name in table):
        own = [table[name] for table in tables if name in table]
        values = {key: [row[key] for row in own] for key in own[0]}
        texts = (f"{key} {np.mean(v):.3f} ± {np.std(v):.3f}{interval(v)}" for key, v in values.items())
        print(f"  {name} ({len(own)}):", ", ".join(texts), flush=True)


def interval(values: Sequence[float]) -> str:
    """Half of the 95 % interval of a mean (Student's t), from three values on."""
    n = len(values)
    if n < 3:
        return ""
    return f" (95 %: {t.ppf(0.975, n - 1) * np.std(values, ddof=1) / np.sqrt(n):.3f})"


def measured(path: Path, judge: Path, given: argparse.Namespace) -> dict[str, Table]:
    """The tables of one repertoire, by title."""
    torch.set_num_threads(1)
    pieces = pieces_of(given.data, given.only, given.beats)
    repertoire = WithNet.open(path)
    nets = ablated_nets(given.ablations / path.stem) if given.ablations else {}
    tables = {
        "ablations": lambda: ablated(pieces, repertoire, cg.Repertoire.open(judge), nets),
        "re-created": lambda: {"re-created": recreated(pieces, repertoire, nets)},
        "variations": lambda: {"variations": varied(pieces, repertoire)},
        "style": lambda: {"style": styled(pieces, repertoire)},
        "feet": lambda: {"feet": feet(pieces, repertoire)},
        "long": lambda: {"long": long_dances(pieces, repertoire)},
    }
    found: dict[str, Table] = {}
    if not (nets or rollout_names(repertoire.net_names)):
        return found
    for title, make in tables.items():
        if title in given.tables:
            found |= make()
    print(f"{path.name} measured", flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="+")
    parser.add_argument("--ablations", type=Path, help="folder of the ablations' networks")
    parser.add_argument("--only", type=Path, default=HELD_OUT, help="names of songs, a line each")
    parser.add_argument("--beats", default=DEFAULT_TRACKER, help="a tracker, or a folder of SONG.txt")
    parser.add_argument("--tables", nargs="+", default=TITLES, choices=TITLES)
    parser.add_argument("--jobs", type=int, default=1, help="repertoires measured at a time")
    given = parser.parse_args()
    measure = partial(measured, given=given)
    with ProcessPoolExecutor(given.jobs) as pool:
        judges = given.repertoires[1:] + given.repertoires[:1]
        found = [tables for tables in pool.map(measure, given.repertoires, judges) if tables]
    for title in found[0]:
        show(title, [tables[title] for tables in found])


if __name__ == "__main__":
    main()
