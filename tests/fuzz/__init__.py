"""Fuzzing of everything that reads a file: `python -m tests.fuzz` (see there), and `tests/test_fuzz.py`.

oracles.py   what must hold for any bytes     corpus.py   good files to begin with     seeds/   files that once broke it
target.py    one reader under libFuzzer (atheris), or under plain mutations where atheris is not installed
"""
