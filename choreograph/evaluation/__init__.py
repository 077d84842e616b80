"""Dances measured: by us and by others, on songs held out, beside real dances and chance.

- `find_songs` — songs of a folder, and real takes to them
- `VARIANTS`, `GROUPS` — ways to dance that are compared, the paper's Table 1 among them
- `evaluate` — dances of variants to songs, and everything measured on them: an `Evaluation`
- `evaluate_dance` — one dance of any system, and its song
- `tables` — mean and spread of every metric by variant
- `write_report`, `to_json` — an evaluation to look at, and for machines
- `METRICS` — what is measured: unit, which direction is better, where it is from
"""

from choreograph.evaluation.catalogue import METRICS, Metric
from choreograph.evaluation.measuring import Scores
from choreograph.evaluation.protocol import Protocol, evaluate
from choreograph.evaluation.report import write_report
from choreograph.evaluation.results import Evaluation, MeasuredDance
from choreograph.evaluation.single import evaluate_dance
from choreograph.evaluation.songs import EvaluatedSong, find_songs
from choreograph.evaluation.tables import Table, tables, to_json
from choreograph.evaluation.variants import GROUPS, VARIANTS, Variant, variants_named

__all__ = [
    "GROUPS", "METRICS", "VARIANTS", "EvaluatedSong", "Evaluation", "MeasuredDance", "Metric", "Protocol",
    "Scores", "Table", "Variant", "evaluate", "evaluate_dance", "find_songs", "tables", "to_json",
    "variants_named", "write_report",
]  # fmt: skip
