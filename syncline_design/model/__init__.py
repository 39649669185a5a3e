"""The Syncline: pure functions and small frozen dataclasses over SI floats (m, s, rad).

`system` says what a system is, `syncline` holds the paper's formulas for plain numbers,
`pairing` which timestamps meet and how far they can be apart, `budget` puts a system's figures
together.
"""
