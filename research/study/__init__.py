"""A study in which people rate dances, or compare two at a time, without knowing which system made which.

Metrics do not say whether people like a dance. In a clone of the repository,

    python -m research.study write --songs heldout/ --variants baselines -o study/

writes a page, `study/study.html`, for the raters, and `study/key.json`, which says which dance is which and
is kept from them. With `--ask pairs`, raters compare two dances of one song. Each rater sends back one file.
Put these files into the folder, and sum them up:

    python -m research.study show study/

The studio asks which of two versions is better. It writes the same files, to `SONG.studio.study/`, and `show`
reads them, too.
"""
