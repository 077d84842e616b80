"""Fits the weights by which `features.bars` tells bars, to synthetic songs: `features/_bar_weights.py`.

Run: python examples/papers/fit_bars.py [--songs FOLDER] [--write]

196 songs of eleven genres with seeds from 2000 on, at all tempi of their genre and 5 % beyond, steady, swung
or with a ramp; and the ten genres of four with one beat of every bar cut out, so that a bar of three is not
a waltz by its instruments. Beats are both the tracked and the true ones. Excerpts of 8 to 48 beats are told
among seven hypotheses (three phases of three, four of four) by a softmax whose scores are sums over beats of
weights times evidence: convex, fitted by L-BFGS with a penalty on the squares. Both metres weigh the same.

Printed with it: how many excerpts of 16 beats of a genre are told right by weights fitted without the genre.
"""
