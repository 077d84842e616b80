"""All metrics of an evaluation by family: name, label, unit, better direction, source and limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

# What each number of an evaluation does not tell, in one clause.


_ONE_TRACKER = "only as right as the tracked beats"
_SMALL_SETS = "biased upwards by small sets"
_MORE_BEATS = "rises with the number of motion beats alone"
_DETECTOR = "one detector's view, and rests need not lie on beats"
_PUBLISHED = "keeps the public code's bugs, for comparison with papers only"

LIMITS: Mapping[str, str] = {
    "counts_within": f"{_ONE_TRACKER}; a dance at half the tempo is on every beat",
    "counts_within_second": "trackers disagree on the octave and by a few hundredths of a second",
    "downbeat_share": "only as right as the tracked bars",
    "downbeat_nearest": "says nothing of how far off the beat",
    "count_error_beats": "a mean: a few counts half a beat off weigh as many a little off",
    "count_error_s": "slow songs allow larger errors",
    "count_drift": "joins that set the count right hide drift within the takes",
    "counts_per_beat": "½ or 2 may be the tracker's octave, not the dance's",
    "counts_read_within": "no higher than the reader is right: compare with the real dances",
    "downbeat_share_read": "bars are what the reader takes for each other most",
    "counted_share": "says that counts are known, not that they are right",
    "transitions_per_minute": "few may mean smooth, or one take played through",
    "transition_gap_s": "a mean: says nothing of the shortest",
    "transitions_on_counts": _ONE_TRACKER,
    "transitions_at_borders": "a tracked bar may begin on a wrong beat",
    "transitions_at_bar_borders": "only as right as the tracked bars",
    "transitions_at_figure_borders": "0 for takes whose figures are not known",
    "f_score_mean": "resting on beats, which experts on the count rarely do",
    "f_score_mean_second": "resting on beats, which experts on the count rarely do",
    "f_score": "the engine's search may minimise this very distance with this detector",
    "f_score_aist": _DETECTOR,
    "f_score_gaussian_50_ms": _DETECTOR,
    "f_score_savitzky_golay": _DETECTOR,
    "f_score_gaussian_100_ms": _DETECTOR,
    "phase_distance": "of one dance, with few motion beats, it is large by chance",
    "phase_nearness": "unstable where experts of a genre share no clear phase",
    "motion_to_music": "0 for a single motion beat in the right place",
    "music_to_motion": "falls with the number of motion beats alone",
    "aligned_share_published": "the paper does not state its filter's length, which decides how many beats",
    "beat_ratio_published": "the paper does not state its filter's length, which decides how many beats",
    "aligned_share": "1 for a single motion beat in the right place",
    "beat_ratio": "says nothing of where the beats are",
    "alignment_fact": "perfect for a single motion beat in the right place",
    "alignment_bailando": _MORE_BEATS,
    "alignment_lodge": _MORE_BEATS,
    "alignment_fact_published": "perfect for a single motion beat in the right place",
    "alignment_bailando_published": _MORE_BEATS,
    "alignment_lodge_published": _MORE_BEATS,
    "energy_response": "over a song's few sections it is large by chance: a mean of many songs tells",
    "energy_response_space": "of single poses: a wide pose held still counts as well",
    "soft_to_loud_speed": "two sections only; a dance that stands still in one section reads 0",
    "soft_to_loud_space": "near 1 for most dances, since a body standing still fills most of it",
    "opening_speed_m_s": "low for a dance that never moves",
    "closing_speed_m_s": "low for a dance that never moves",
    "closing_held": "one slow frame at the end is enough",
    "hold_delay_s": "of the dances that hold their last pose only; below 0 if held before",
    "fpd": "of poses by rotations: no time, no music; a single dance is never as varied as the real ones",
    "fmd": "of three poses at a time: no phrase, no music",
    "fpd_all": _SMALL_SETS,
    "fmd_all": _SMALL_SETS,
    "fid_k": _SMALL_SETS,
    "fid_g": _SMALL_SETS,
    "diversity_k": "noise is diverse",
    "diversity_g": "noise is diverse",
    "fid_k_published": _PUBLISHED,
    "fid_g_published": _PUBLISHED,
    "diversity_k_published": _PUBLISHED,
    "diversity_g_published": _PUBLISHED,
    "label_distance_openness": "supposes that open poses go with wide note intervals",
    "label_distance_intensity": "supposes that fast motion goes with dense onsets",
    "label_distance_rhythm": "supposes that motion beats are as dense as onsets",
    "label_distance_asymmetry": "supposes that asymmetric poses go with bright spectra",
    "foot_slide_cm_s": "a dance's own glides count as sliding",
    "foot_skating_ratio": "a dance's own glides count as skating",
    "foot_skating_ratio_published": _PUBLISHED,
    "pfc": "one jump of the body scales the whole dance",
    "pfc_pieces": "low for a dance that hardly moves",
    "floor_penetration_cm": "soles are estimated from the rig",
    "floating_share": "soles are estimated from the rig",
    "jerk_p95_m_s3": "at 20 fps: misses pops of a frame or two",
    "jerk_ratio_at_boundaries": "low as well where the rest is jerky",
    "speed_ratio_at_boundaries": "1 for a still body at transitions between still poses",
    "jumps_per_minute": "an accent of a hand that is faster than 5 cm a frame² would count as well",
    "limb_length_spread_mm": "0 for any motion of a skeleton",
    "signature_chi2": "by one word network, named above: what it does not see does not count",
    "transition_bits": "low for a dance that repeats its genre's commonest step",
    "section_agreement": "needs repeated sections that were found in the song",
    "section_agreement_in_step": "lost by one word more or less",
    "longest_repeat_motifs": "two words of one motif may differ",
    "longest_repeat_s": "does not see the same step in another take",
    "distinct_takes_per_minute": "high for a patchwork",
    "own_genre": "the take's label, whatever the part of it looks like",
    "slope_p05": "of seconds of takes only, not of words",
    "slope_median": "of seconds of takes only, not of words",
    "slope_p95": "of seconds of takes only, not of words",
    "share_at_slowest": "of seconds of takes only, not of words",
    "share_at_fastest": "of seconds of takes only, not of words",
    "precision": "genre is coarser than style",
    "recall": "at most 50 clips over the genre's clips",
    "mean_reciprocal_rank": "of the first clip of the genre only",
}


# All metrics of an evaluation by family: name, label, unit, better direction, source and limits.


Better = Literal["higher", "lower", "real"]  # "real": the closer to real dances, the better


@dataclass(frozen=True)
class Metric:
    """How a metric is displayed and read."""

    name: str
    family: str
    label: str
    unit: str
    better: Better
    source: str
    digits: int = 2

    @property
    def limits(self) -> str:
        """What the number does not tell, in one clause."""
        return LIMITS[self.name]


def _family(family: str, *rows: tuple) -> list[Metric]:
    return [Metric(name, family, label, unit, *rest) for name, label, unit, *rest in rows]


FAMILIES = {
    "counts": "A dance's counts are those of its takes, from data or annotation, not from a detector: where "
    "they lie against the song's beats, and count 1 against its downbeats. Chance is the same dance to the "
    "song turned round: 0.30 within 0.15 beat. Takes without counts are left out.",
    "transitions": "Joins where one take gives way to another. Chance is transitions at random instants.",
    "beats": "Motion beats are local minima of mean joint speed, by five detectors that smooth it in "
    "different ways. Experts who are exactly on the count read little more than chance: bodies rest where a "
    "genre's technique has them rest. So compare with experts, not with 1. The beat tracker is named above. "
    "Chance is the same dance shifted in time, with the end wrapped to the start.",
    "energy": "Loudness of the song's sections against the size of the motion in them: joint speed relative "
    "to the pelvis, and the volume of the body's convex hull. Songs of fewer than three sections or a range "
    "below 2 dB are left out. Chance is the same dance turned round in time.",
    "endings": "Whether the dance begins and closes in a held pose: below 0.15 m/s is held.",
    "realism": "Fréchet distance of each dance to the real dances to other songs. A single dance never "
    "covers their variety, so compare with the column of the real dances. Chance is a body frozen in one "
    "pose of the dance.",
    "sets": "All dances of a variant and seed together against all real dances, by features of pieces "
    "of 20 s. The column of the real dances compares two halves of them. With fewer pieces than "
    "dimensions (72 and 32) distances are biased upwards, most of all for the halves.",
    "labels": "Distance between the labels of the dance and of its music, both as ranks from 1 to 10 in "
    "the reference. Chance pairs every window of the dance with every window of the music.",
    "physics": "Takes used are the takes that the dances of the first variant are made of.",
    "motifs": "Distance between the dance's motif signature and its genre's template: 0 if equal, 1 if "
    "they have no motif in common. The word network that judges is named above: the own network also priced "
    "the dances. Chance is words drawn from the whole repertoire; for transitions, the same motifs in any "
    "order.",
    "structure": "Whether a dance repeats itself, and whether it does so where its song does: how many "
    "more motifs two sections of the same music share than two other sections (chance is 0). And how much "
    "of the repertoire it uses.",
    "warping": "Playback speed of the takes, 1 as recorded. The limits are ½ and 2.",
    "retrieval": "Clips ranked by the distance between their style and that of each second of a song. "
    "Chance is a random ranking.",
}

_CG = "ChoreoGraph"
_RD = "Rhythm is a Dancer"
_MIR = "MIR's beat tracking F-measure"
METRICS: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        *_family(
            "counts",
            ("counts_within", "counts within 0.15 beat of a beat", "share", "higher", "ours"),
            ("counts_within_second", "the same by the second tracker", "share", "higher", "ours"),
            ("downbeat_share", "count 1 within 0.15 beat of a downbeat", "share", "higher", "ours"),
            ("downbeat_nearest", "count 1 nearest to a downbeat", "share", "higher", "ours"),
            ("count_error_beats", "distance from count to beat", "beats", "lower", "ours", 3),
            ("count_error_s", "distance from count to beat", "s", "lower", "ours", 3),
            ("count_drift", "drift of the counts", "beats/min", "lower", "ours"),
            ("counts_per_beat", "counts per beat", "", "real", "ours"),
            ("counted_share", "danced from takes with counts", "share", "higher", "ours"),
            (
                "counts_read_within",
                "counts read from the motion, within 0.15 beat",
                "share",
                "higher",
                "ours",
            ),
            (
                "downbeat_share_read",
                "count 1 read, within 0.15 beat of a downbeat",
                "share",
                "higher",
                "ours",
            ),
        ),
        *_family(
            "transitions",
            ("transitions_per_minute", "transitions", "/min", "real", "ours", 1),
            ("transition_gap_s", "from a transition to the next", "s", "real", "ours", 1),
            ("transitions_on_counts", "transitions on beats", "share", "higher", "ours"),
            ("transitions_at_borders", "transitions at bar or figure borders", "share", "higher", "ours"),
            ("transitions_at_bar_borders", "transitions at bar borders", "share", "higher", "ours"),
            ("transitions_at_figure_borders", "transitions at figure borders", "share", "higher", "ours"),
        ),
        *_family(
            "beats",
            ("f_score_mean", "F-score at 70 ms, mean of five detectors", "", "real", _MIR),
            ("f_score_mean_second", "the same by the second tracker", "", "real", _MIR),
            ("f_score", "F-score, our detector", "", "real", _MIR),
            ("f_score_aist", "F-score, AIST++'s detector", "", "real", _MIR),
            ("f_score_gaussian_50_ms", "F-score, Gaussian of 0.05 s", "", "real", _MIR),
            ("f_score_savitzky_golay", "F-score, Savitzky-Golay of 0.35 s", "", "real", _MIR),
            ("f_score_gaussian_100_ms", "F-score, Gaussian of 0.1 s", "", "real", _MIR),
            ("phase_distance", "phase in the count, distance to experts", "beats", "lower", "ours", 3),
            ("phase_nearness", "the same from chance (0) to experts (1)", "", "higher", "ours"),
            ("motion_to_music", "motion to music beats", "(1/60 s)²", "real", f"{_CG}, Table 1", 1),
            ("music_to_motion", "music to motion beats", "(1/60 s)²", "real", f"{_CG}, Table 1", 1),
            ("aligned_share_published", "aligned kinematic beats", "share", "real", f"{_RD}, 5.4.1"),
            ("beat_ratio_published", "kinematic beats per music beat", "", "real", f"{_RD}, 5.4.1"),
            ("aligned_share", "aligned motion beats, our detector", "share", "real", f"after {_RD}, 5.4.1"),
            ("beat_ratio", "motion beats per music beat, our detector", "", "real", f"after {_RD}, 5.4.1"),
            ("alignment_fact", "beat alignment, FACT's σ", "", "real", "AI Choreographer"),
            ("alignment_bailando", "beat alignment, Bailando's σ", "", "real", "Bailando"),
            ("alignment_lodge", "beat alignment, LODGE's σ", "", "real", "LODGE"),
            ("alignment_fact_published", "BAS by FACT's code", "", "real", "AI Choreographer"),
            ("alignment_bailando_published", "BAS by Bailando's code", "", "real", "Bailando"),
            ("alignment_lodge_published", "BAS by LODGE's code", "", "real", "LODGE"),
        ),
        *_family(
            "energy",
            ("energy_response", "correlation of loudness and joint speed", "", "higher", "ours"),
            (
                "energy_response_space",
                "correlation of loudness and space of the body",
                "",
                "higher",
                "ours",
            ),
            ("soft_to_loud_speed", "joint speed, softest section / loudest", "", "lower", "ours"),
            ("soft_to_loud_space", "space of the body, softest section / loudest", "", "lower", "ours", 3),
        ),
        *_family(
            "endings",
            ("opening_speed_m_s", "joint speed in the first 0.3 s", "m/s", "lower", "ours"),
            ("closing_speed_m_s", "joint speed in the last 0.3 s", "m/s", "lower", "ours"),
            ("closing_held", "closes in a held pose", "share", "higher", "ours"),
            ("hold_delay_s", "from the last downbeat to the held pose", "s", "lower", "ours"),
        ),
        *_family(
            "realism",
            ("fpd", "FPD (poses)", "rad²", "lower", f"{_CG}, Table 1", 3),
            ("fmd", "FMD (movements of three poses)", "rad²", "lower", f"{_CG}, Table 1", 3),
        ),
        *_family(
            "sets",
            ("fpd_all", "FPD, pooled", "rad²", "lower", f"{_CG}, Table 1, pooled", 3),
            ("fmd_all", "FMD, pooled", "rad²", "lower", f"{_CG}, Table 1, pooled", 3),
            ("fid_k", "FID_k, corrected", "", "lower", "AI Choreographer, corrected", 1),
            ("fid_g", "FID_g, corrected", "", "lower", "AI Choreographer, corrected", 1),
            ("diversity_k", "diversity_k, corrected", "", "real", "AI Choreographer, corrected", 1),
            ("diversity_g", "diversity_g, corrected", "", "real", "AI Choreographer, corrected", 1),
            ("fid_k_published", "FID_k as published", "", "lower", "public code with its bugs", 1),
            ("fid_g_published", "FID_g as published", "", "lower", "public code with its bugs", 1),
            ("diversity_k_published", "diversity_k as published", "", "real", "public code with its bugs", 1),
            ("diversity_g_published", "diversity_g as published", "", "real", "public code with its bugs", 1),
        ),
        *_family(
            "labels",
            ("label_distance_openness", "openness / note intervals", "", "lower", f"{_CG}, Table 2"),
            ("label_distance_intensity", "intensity / onset density", "", "lower", f"{_CG}, Table 2"),
            ("label_distance_rhythm", "rhythm / inter-onset interval", "", "lower", f"{_CG}, Table 2"),
            ("label_distance_asymmetry", "asymmetry / spectrum", "", "lower", f"{_CG}, Table 2"),
        ),
        *_family(
            "physics",
            ("foot_slide_cm_s", "foot sliding", "cm/s", "lower", "ours"),
            ("foot_skating_ratio", "foot skating ratio, corrected", "share", "lower", "LODGE, corrected", 3),
            ("foot_skating_ratio_published", "foot skating ratio as published", "share", "lower", "LODGE", 3),
            ("pfc", "PFC", "", "lower", "EDGE", 3),
            ("pfc_pieces", "PFC in pieces of 5 s", "", "lower", "EDGE, corrected", 3),
            ("floor_penetration_cm", "floor penetration", "cm", "lower", "ours", 3),
            ("floating_share", "floating", "share", "lower", "ours", 3),
            ("jerk_p95_m_s3", "jerk, 95th percentile", "m/s³", "real", "ours", 1),
            ("jerk_ratio_at_boundaries", "jerk at transitions / elsewhere", "", "lower", "ours"),
            ("speed_ratio_at_boundaries", "speed at transitions / elsewhere", "", "real", "ours"),
            ("jumps_per_minute", "one-frame jumps per minute", "", "lower", "ours", 1),
            ("limb_length_spread_mm", "bone length deviation", "mm", "lower", "ours"),
        ),
        *_family(
            "motifs",
            ("signature_chi2", "signature χ² to the genre's", "", "lower", f"{_RD}, equation 11", 3),
            ("transition_bits", "surprisal of a motif transition", "bits", "lower", f"{_RD}, 4.3"),
        ),
        *_family(
            "structure",
            ("section_agreement", "same motifs when the music repeats", "", "higher", "ours"),
            ("section_agreement_in_step", "same motifs in the same order", "", "higher", "ours"),
            ("longest_repeat_motifs", "longest repeated motif sequence", "words", "real", "ours", 1),
            ("longest_repeat_s", "longest repeated piece of a take", "s", "lower", "ours", 1),
            ("distinct_takes_per_minute", "different takes per minute", "", "higher", "ours", 1),
            ("own_genre", "danced with takes of the song's genre", "share", "higher", "ours"),
        ),
        *_family(
            "warping",
            ("slope_p05", "playback speed, 5th percentile", "", "real", f"{_CG}, 3.2"),
            ("slope_median", "playback speed, median", "", "real", f"{_CG}, 3.2"),
            ("slope_p95", "playback speed, 95th percentile", "", "real", f"{_CG}, 3.2"),
            ("share_at_slowest", "frames at the slowest speed", "share", "lower", f"{_CG}, 3.2", 3),
            ("share_at_fastest", "frames at the fastest speed", "share", "lower", f"{_CG}, 3.2", 3),
        ),
        *_family(
            "retrieval",
            ("precision", "precision of the genre at 50 clips", "share", "higher", "ours"),
            ("recall", "recall of the genre at 50 clips", "share", "higher", "ours", 3),
            ("mean_reciprocal_rank", "mean reciprocal rank of the genre", "", "higher", "ours"),
        ),
    )
}
