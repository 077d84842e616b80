"""What does each cost change? Dances at weight 0 and at three times the weight, by a ruler beside the cost.

    python -m research.cost_weights [--repertoire REP] [--judge REP] [--songs 5 8 10] [--data FOLDER]

The songs are those of `research.form_dances`, by their numbers. With --data, they are the first 45 s of songs
of dance-with-melody, by name, with estimated beats and phrases. For every cost of the graph engine, a row has
the ruler, its mean at weight 0, at the default weight and at three times the default weight, and the same of
the Fréchet distance of poses to the takes. Then comes the share of the seconds that are danced by another
part of a take than with the default weights, at both other weights. The first line has it for another seed. A
cost of weight 0 is tried at 2 instead of three times itself. The ruler of `seed` is that share between two
seeds. A judge is a repertoire with another word network, by which motifs are read. With --all, the scores
that differ by more than two standard errors over songs follow each row.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
import soundfile

import choreograph as cg
from choreograph.choreography.graph import engine
from choreograph.choreography.graph.costs import DEFAULT_WEIGHTS
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.counts import Counts
from choreograph.core.timebase import NET_FPS, SAMPLE_RATE_HZ
from choreograph.evaluation.metrics import beat, energy_response, frechet, physical, transitions
from choreograph.evaluation.plan_scores import MotifScorer, plan_scores, transition_scores
from choreograph.evaluation.songs import find_songs, song_music
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.music.form import Form
from choreograph.music.song_features import SongFeatures
from content.songs.known_forms import FormSong
from content.songs.synthesis.sounds import RATE_HZ
from research.form_dances import RETURNING, Row, measured, true_form

FROM_ZERO = 2.0
SAME_S = 0.1
WINDOW_S = 4.0
DURATION_S = 45.0
LEAST_ERRORS = 2.0
GENRES = {"C": "cha-cha", "R": "rumba", "T": "tango", "W": "waltz"}  # by the letter in the name of a song
FEET = tuple(BODY_JOINTS.index(f"{side}_ankle") for side in ("left", "right"))
RULERS = {
    "genre": "own_genre",
    "completeness": "change_every_s",
    "transition": "jerk_ratio_at_joins",
    "velocity": "jerk_ratio_at_joins",
    "rhythm": "f_score_mean",
    "accents": "f_score_mean",
    "bars": "downbeat_share",
    "phrasing": "transitions_at_bar_borders",
    "energy": "speed_response",
    "steps": "feet_response",
    "stillness": "ends_speed_m_s",
    "pace": "foot_slide_cm_s",
    "variety": "distinct_takes_per_minute",
    "repeat": "longest_repeat_s",
    "seed": "",
    "signature": "signature_chi2",
    "motif_transition": "transition_bits",
    "front": "turned_away_share",
    "form": "return_distance_ratio",
}


@dataclass(frozen=True, eq=False)
class Case:
    """A song with its analysis, and what its dances are judged by."""

    counts: Counts
    form: Form
    song: cg.Song
    analysis: tuple[SongFeatures, tuple[str, ...]]
    genre: str
    layers: dict[tuple[bool, int], Any] = field(default_factory=dict)

    def dance(self, repertoire: cg.Repertoire, *, more: int = 0, **weights: float) -> cg.Dance:
        """The dance with these weights. The nodes depend on the seed and on whether `form` has a weight."""
        made, key = engine.make_layers, (weights.get("form") == 0.0, more)

        def layers(*arguments: Any) -> Any:
            if key not in self.layers:
                self.layers[key] = made(*arguments)
            return self.layers[key]

        with (
            patch("choreograph.pipeline.dancing.analyse_song", return_value=self.analysis),
            patch.object(engine, "make_layers", layers),
        ):
            return cg.dance(self.song, repertoire, seed=more, weights=weights)

    def scores(self, made: cg.Dance, repertoire: cg.Repertoire, scorer: MotifScorer) -> Row:
        """Scores of the dance."""
        body, fps = body_pos_m(made.motion), made.motion.fps
        row = measured(made, repertoire, self.form, self.counts)
        row["foot_slide_cm_s"] = physical.foot_slide_cm_s(body, fps)
        row |= plan_scores(made.plan, repertoire, self.genre).values
        row |= transition_scores(made.plan, repertoire, self.counts).values
        row |= beat.evaluate_detectors(body, fps, self.counts.times_s)
        row |= scorer.scores(scorer.motifs_of(made.motion, self.counts.times_s), self.genre).values
        ends = transitions.evaluate_ends(body, fps)
        row["ends_speed_m_s"] = (ends["opening_speed_m_s"] + ends["closing_speed_m_s"]) / 2
        bounds_s = np.arange(made.plan.opening_s, made.plan.danced_until_s, WINDOW_S)
        loudness_db = energy_response.section_loudness_db(self.song.samples, SAMPLE_RATE_HZ, bounds_s)
        row["speed_response"] = energy_response.speed_response(body, fps, bounds_s, loudness_db)
        onsets = self.analysis[0].onset_density[np.floor(bounds_s[:-1]).astype(int)].astype(np.float64)
        feet = np.repeat(body[:, FEET], 11, axis=1)[:, :21]  # the ruler takes the mean over 21 joints
        row["feet_response"] = energy_response.speed_response(feet, fps, bounds_s, onsets)
        return {name: float(value) for name, value in row.items()}


@dataclass(frozen=True, eq=False)
class Tried:
    """The dances of one set of weights, with their scores."""

    dances: Sequence[cg.Dance]
    rows: Sequence[Row]
    fpd: float

    def mean(self, name: str) -> float:
        """The mean of a score where it is known."""
        return float(np.nanmean([row.get(name, np.nan) for row in self.rows]))

    def other_share(self, other: Tried) -> float:
        """The share of the seconds with another part of a take."""
        same = [
            a.take == b.take and abs(a.source_times_s[0] - b.source_times_s[0]) < SAME_S
            for one, two in zip(self.dances, other.dances, strict=True)
            for a, b in zip(one.plan.seconds, two.plan.seconds, strict=True)
        ]
        return 1.0 - float(np.mean(same))

    def differences(self, other: Tried) -> str:
        """The scores of the other dances that differ clearly from these."""
        cells = []
        for name in self.rows[0]:
            usual, new = (np.array([row.get(name, np.nan) for row in tried.rows]) for tried in (self, other))
            change = (new - usual)[np.isfinite(new - usual)]
            if len(change) < 2:
                continue
            error = float(change.std(ddof=1) / np.sqrt(len(change)))
            if abs(change.mean()) > max(LEAST_ERRORS * error, 1e-6):
                cells.append(f"{name} {np.nanmean(usual):.3g} {change.mean():+.2g}")
        return ", ".join(cells) or "nothing clear"


def synthetic_cases(songs: Sequence[FormSong], repertoire: cg.Repertoire) -> list[Case]:
    """Songs of known form. Each song is analysed once."""
    made = []
    with TemporaryDirectory() as folder:
        for index, song in enumerate(songs):
            audio = song.render()
            path = Path(folder) / f"song{index}.wav"
            soundfile.write(path, audio.samples, RATE_HZ)
            loaded = cg.load_song(path)
            analysis = analyse_song(loaded, repertoire)
            made.append(Case(audio.counts, true_form(audio), loaded, analysis, song.genre))
    return made


def real_cases(folder: Path, names: Sequence[str], repertoire: cg.Repertoire) -> list[Case]:
    """Songs of dance-with-melody, judged by the counts of another tracker and by their estimated phrases."""
    made = []
    for found in find_songs(folder, only=names):
        loaded = found.load().part(0.0, DURATION_S)
        analysis = analyse_song(loaded, repertoire)
        counts = song_music(loaded, "tempo-path").levels[0]
        made.append(Case(counts, analysis[0].form, loaded, analysis, GENRES[found.name.split("_")[1]]))
    return made


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repertoire", type=Path, help="default: the built-in one")
    parser.add_argument("--judge", type=Path, help="default: the repertoire itself")
    parser.add_argument("--songs", nargs="+", default=["5", "8", "10"])
    parser.add_argument("--data", type=Path, help="dance-with-melody, whose songs are meant")
    parser.add_argument("--costs", nargs="+", default=list(DEFAULT_WEIGHTS))
    parser.add_argument("--all", action="store_true", help="also print which scores differ clearly")
    given = parser.parse_args()
    repertoire = cg.Repertoire.open(given.repertoire) if given.repertoire else cg.starter_repertoire()
    scorer = MotifScorer(cg.Repertoire.open(given.judge) if given.judge else repertoire)
    takes = [repertoire.motion(take)[0].resampled(NET_FPS) for take in range(len(repertoire.takes))]
    if given.data:
        made = real_cases(given.data, given.songs, repertoire)
    else:
        made = synthetic_cases([RETURNING[int(number)] for number in given.songs], repertoire)

    def tried(weights: Mapping[str, float], more: int = 0) -> Tried:
        dances = [case.dance(repertoire, more=more, **weights) for case in made]
        rows = [case.scores(dance, repertoire, scorer) for case, dance in zip(made, dances, strict=True)]
        fpd = frechet.fpd([dance.motion.resampled(NET_FPS) for dance in dances], takes)
        return Tried(dances, rows, fpd)

    usual = tried({})
    other_seed = tried({}, 100)
    print(f"another seed changes {usual.other_share(other_seed):.2f} of the seconds, "
          f"FPD {usual.fpd:.3f} and {other_seed.fpd:.3f}", flush=True)  # fmt: skip
    for name in given.costs:
        weight = DEFAULT_WEIGHTS[name]
        without = tried({name: 0.0}) if weight else usual
        more = tried({name: 3.0 * weight or FROM_ZERO})
        ruler = RULERS[name]
        values = [one.mean(ruler) for one in (without, usual, more)]
        if name == "seed":
            values = [
                one.other_share(tried({name: of}, 100) if one is not usual else other_seed)
                for one, of in ((without, 0.0), (usual, weight), (more, 3.0 * weight))
            ]
        cells = " → ".join(f"{value:.3g}" for value in values)
        fpd = " → ".join(f"{one.fpd:.2f}" for one in (without, usual, more))
        moved = "; ".join(f"{usual.other_share(one):.2f}" for one in (without, more))
        print(f"| `{name}` | {ruler or 'another seed'} | {cells} | {fpd} | {moved} |", flush=True)
        if given.all:
            print(f"  {name} 0: {usual.differences(without)}", flush=True)
            print(f"  {name} more: {usual.differences(more)}", flush=True)


if __name__ == "__main__":
    main()
