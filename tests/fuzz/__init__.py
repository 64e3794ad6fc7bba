"""Damaged files: whatever bytes a reader is given, it answers with data or with an error in words.

`make fuzz` runs ten thousand mutants, the suite a few hundred. Each mutant follows from the seed and the number that a
finding names, so it can be made again: `python -m tests.fuzz --only SEED --first NUMBER --mutants 1 --keep FOLDER`.
"""
