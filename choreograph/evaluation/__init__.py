"""Evaluation of dances to held-out songs, against real dances and chance, by metrics and by human raters.

Measuring

- `evaluate`, `EvaluationConfig` — dance to songs in several variants and measure: an `Evaluation`
- `evaluate_dance` — measure one dance of any system to its song
- `CountedDance` — a dance to measure beside the variants: an expert's, laid on the beats
- `read_experts` — such dances from files
- `danced_counts` — the counts of the takes as they lie in a dance
- `kept_dances` — a folder that keeps the dances of an evaluation until it is complete
- `find_songs` — the songs in a folder, with real takes to them
- `VARIANTS`, `GROUPS`, `variants_named` — the variants that are compared, the paper's Table 1 among them

Results

- `tables` — mean and spread of every metric by variant
- `write_report`, `to_json` — the evaluation as an HTML page or as JSON
- `METRICS` — unit, better direction, source and limits of every metric

Rating studies (import from their modules)

- `study.write_study`, `study_dances.make_study_dances` — a blinded page on which people rate dances
- `study_results.read_study` — means, intervals and differences of the ratings
"""

from choreograph.evaluation.counted_dance import CountedDance
from choreograph.evaluation.danced_counts import danced_counts
from choreograph.evaluation.experts import read_experts
from choreograph.evaluation.kept_dances import KeptDances, kept_dances
from choreograph.evaluation.metric_catalogue import METRICS, Metric
from choreograph.evaluation.report import write_report
from choreograph.evaluation.results import Evaluation, MeasuredDance
from choreograph.evaluation.run import EvaluationConfig, evaluate
from choreograph.evaluation.scores import Scores
from choreograph.evaluation.single_dance import evaluate_dance
from choreograph.evaluation.songs import EvaluatedSong, find_songs
from choreograph.evaluation.tables import Table, tables, to_json
from choreograph.evaluation.variants import GROUPS, VARIANTS, Variant, variants_named

__all__ = [
    "GROUPS", "METRICS", "VARIANTS", "CountedDance", "EvaluatedSong", "Evaluation", "EvaluationConfig",
    "KeptDances", "MeasuredDance", "Metric", "Scores", "Table", "Variant", "danced_counts", "evaluate",
    "evaluate_dance", "find_songs", "kept_dances", "read_experts", "tables", "to_json", "variants_named",
    "write_report",
]  # fmt: skip
