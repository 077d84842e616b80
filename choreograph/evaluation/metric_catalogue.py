"""What is measured: the name, unit and better direction of every metric, by family, with where it is from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Better = Literal["higher", "lower", "real"]  # "real": as real dances have it


@dataclass(frozen=True)
class Metric:
    """How a number is shown and read."""

    name: str
    family: str
    label: str
    unit: str
    better: Better
    source: str
    digits: int = 2


def _family(family: str, *rows: tuple) -> list[Metric]:
    return [Metric(name, family, label, unit, *rest) for name, label, unit, *rest in rows]


FAMILIES = {
    "beats": "Motion beats are local minima of mean joint speed; music beats are those named above. "
    "Chance is the same dance turned round its song.",
    "realism": "Fréchet distances of one dance at a time to the real dances to other songs. One dance is no "
    "repertoire: read the real column, too. Chance is a body that stands still in one of the dance's poses.",
    "sets": "All dances of a variant and seed together, features of pieces of 20 s, against all real ones; "
    "the real column is one half of the real dances against the other. With fewer pieces than dimensions "
    "(72 and 32) distances are biased upwards, and more so for the halves.",
    "labels": "Distance of the dance's to the music's label, both as ranks 1 to 10 among the reference. "
    "Chance is every window danced to every other's music.",
    "physics": "Beside the dances stand the repertoire's takes that they are made of.",
    "motifs": "Distance of the dance's motif signature to its genre's template: 0 the same, 1 nothing in "
    "common. Chance is words drawn from all the repertoire's; for steps, the same motifs in any order.",
    "structure": "Whether a dance repeats itself, and where its song does: how much more of their moves two "
    "sections of the same music share than two others (chance is 0); and how much of the repertoire it uses.",
    "warping": "How fast the takes are played, 1 as recorded: the warper's limits are ½ and 2.",
    "retrieval": "Clips by distance of their style to that of every second of a song. Chance is clips in any "
    "order.",
}

_CG = "ChoreoGraph"
_RD = "Rhythm is a Dancer"
METRICS: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        *_family(
            "beats",
            ("f_score", "F-score at 70 ms", "", "higher", "MIR's beat tracking F-measure"),
            ("motion_to_music", "motion to music beats", "(1/60 s)²", "lower", f"{_CG}, Table 1", 1),
            ("music_to_motion", "music to motion beats", "(1/60 s)²", "lower", f"{_CG}, Table 1", 1),
            ("aligned_share", "aligned motion beats", "share", "higher", f"{_RD}, 5.4.1"),
            ("beat_ratio", "motion beats per music beat", "", "real", f"{_RD}, 5.4.1"),
            ("alignment_fact", "alignment, FACT's σ", "", "higher", "AI Choreographer"),
            ("alignment_bailando", "alignment, Bailando's σ", "", "higher", "Bailando"),
            ("alignment_lodge", "alignment, LODGE's σ", "", "higher", "LODGE"),
            ("alignment_fact_published", "BAS as FACT's code", "", "higher", "AI Choreographer"),
            ("alignment_bailando_published", "BAS as Bailando's code", "", "higher", "Bailando"),
            ("alignment_lodge_published", "BAS as LODGE's code", "", "higher", "LODGE"),
        ),
        *_family(
            "realism",
            ("fpd", "FPD: poses", "rad²", "lower", f"{_CG}, Table 1", 3),
            ("fmd", "FMD: three poses", "rad²", "lower", f"{_CG}, Table 1", 3),
        ),
        *_family(
            "sets",
            ("fpd_all", "FPD, all together", "rad²", "lower", f"{_CG}, Table 1, pooled", 3),
            ("fmd_all", "FMD, all together", "rad²", "lower", f"{_CG}, Table 1, pooled", 3),
            ("fid_k", "FID_k, corrected", "", "lower", "AI Choreographer, mended", 1),
            ("fid_g", "FID_g, corrected", "", "lower", "AI Choreographer, mended", 1),
            ("diversity_k", "diversity_k, corrected", "", "real", "AI Choreographer, mended", 1),
            ("diversity_g", "diversity_g, corrected", "", "real", "AI Choreographer, mended", 1),
            ("fid_k_published", "FID_k as published", "", "lower", "the field's code, bugs kept", 1),
            ("fid_g_published", "FID_g as published", "", "lower", "the field's code, bugs kept", 1),
            ("diversity_k_published", "diversity_k as published", "", "real", "the field's code", 1),
            ("diversity_g_published", "diversity_g as published", "", "real", "the field's code", 1),
        ),
        *_family(
            "labels",
            ("label_distance_openness", "openness / intervals", "", "lower", f"{_CG}, Table 2"),
            ("label_distance_intensity", "intensity / onset density", "", "lower", f"{_CG}, Table 2"),
            ("label_distance_rhythm", "rhythm / time between onsets", "", "lower", f"{_CG}, Table 2"),
            ("label_distance_asymmetry", "asymmetry / spectrum", "", "lower", f"{_CG}, Table 2"),
        ),
        *_family(
            "physics",
            ("foot_slide_cm_s", "foot slide", "cm/s", "lower", "ours"),
            ("foot_skating_ratio", "foot skating ratio, corrected", "share", "lower", "LODGE, mended", 3),
            ("foot_skating_ratio_published", "foot skating ratio", "share", "lower", "LODGE", 3),
            ("pfc", "PFC", "", "lower", "EDGE", 3),
            ("pfc_pieces", "PFC in pieces of 5 s", "", "lower", "EDGE, mended", 3),
            ("floor_penetration_cm", "floor penetration", "cm", "lower", "ours", 3),
            ("floating_share", "floating", "share", "lower", "ours", 3),
            ("jerk_p95_m_s3", "jerk, 95th percentile", "m/s³", "real", "ours", 1),
            ("jerk_ratio_at_boundaries", "jerk at joins over elsewhere", "", "lower", "ours"),
            ("speed_ratio_at_boundaries", "speed at joins over elsewhere", "", "real", "ours"),
            ("limb_length_spread_mm", "bone length spread", "mm", "lower", "ours"),
        ),
        *_family(
            "motifs",
            ("signature_chi2", "signature χ² to the genre's", "", "lower", f"{_RD}, equation 11", 3),
            ("transition_bits", "surprise of a step between motifs", "bits", "lower", f"{_RD}, 4.3"),
        ),
        *_family(
            "structure",
            ("section_agreement", "moves shared when the music comes again", "", "higher", "ours"),
            ("section_agreement_in_step", "the same moves in the same order", "", "higher", "ours"),
            ("longest_repeat_motifs", "longest motif sequence danced twice", "words", "real", "ours", 1),
            ("longest_repeat_s", "longest piece of a take played twice", "s", "lower", "ours", 1),
            ("distinct_takes_per_minute", "different takes a minute", "", "higher", "ours", 1),
            ("own_genre", "danced with takes of the song's genre", "share", "higher", "ours"),
        ),
        *_family(
            "warping",
            ("slope_p05", "speed of the takes, 5th percentile", "", "real", f"{_CG}, 3.2"),
            ("slope_median", "speed of the takes, median", "", "real", f"{_CG}, 3.2"),
            ("slope_p95", "speed of the takes, 95th percentile", "", "real", f"{_CG}, 3.2"),
            ("share_at_slowest", "frames as slow as may be", "share", "lower", f"{_CG}, 3.2", 3),
            ("share_at_fastest", "frames as fast as may be", "share", "lower", f"{_CG}, 3.2", 3),
        ),
        *_family(
            "retrieval",
            ("precision", "of the first 50 clips, of the song's genre", "share", "higher", "ours"),
            ("recall", "of the genre's clips, among the first 50", "share", "higher", "ours", 3),
            ("mean_reciprocal_rank", "mean reciprocal rank of the genre", "", "higher", "ours"),
        ),
    )
}
