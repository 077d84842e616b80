"""Networks that ship with the package, in two sets; `MODEL_CARD.md` says what each was trained on.

clean      the project's own takes alone
research   also data sets that state no licence

Each file holds networks by name (`choreograph.repertoire.store.read_networks`) and the songs they heard.
"""

from choreograph.pretrained.library import (
    CHOICES,
    DEFAULT,
    PRETRAINED,
    PretrainedNet,
    pretrained_set,
    shipped_checksums,
)

__all__ = ["CHOICES", "DEFAULT", "PRETRAINED", "PretrainedNet", "pretrained_set", "shipped_checksums"]
