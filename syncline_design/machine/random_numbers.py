"""The one place where generators of random numbers are made, always from a seed handed down."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.random import PCG64, Generator, Philox, SeedSequence


def generator(
    seed: int | Sequence[int], *key: int, bits: type[Philox | PCG64] = Philox
) -> Generator:
    """The stream number `key` of a seed: independent for every key, the same for every run.

    seed: of several whole numbers all together.  Philox counts, so that streams never meet; the
    other is numpy's usual one, for streams that were drawn from it first and stay as they are.
    """
    entropy = seed if isinstance(seed, int) else list(seed)
    return Generator(bits(SeedSequence(entropy, spawn_key=key)))
