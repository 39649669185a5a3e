"""One place makes generators of random numbers; its streams are those of the definitions."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.random import PCG64, Philox, SeedSequence

from syncline_design.machine.random_numbers import generator

PACKAGE = Path(__file__).parent.parent / "syncline_design"
MADE = re.compile(r"default_rng|\bPhilox\b|\bPCG64\(|\bSeedSequence\(|RandomState|random\.Random\(")
OWN = {
    "machine/random_numbers.py": "the one place",
    "verdict/cloud.py": "which of very many designs the background of a picture shows",
}


def philox_words(key: np.ndarray, blocks: int) -> list[int]:
    """Philox4x64-10 by its definition (Salmon and others, SC11), in whole numbers.

    numpy counts up before it draws, so the first block is that of counter 1.
    """
    mask, found = 2**64 - 1, []
    for count in range(1, blocks + 1):
        (k0, k1), x = (int(k) for k in key), [count, 0, 0, 0]
        for _ in range(10):
            a, b = 0xD2E7470EE14C6C93 * x[0], 0xCA5A826395121157 * x[2]
            x = [(b >> 64) ^ x[1] ^ k0, b & mask, (a >> 64) ^ x[3] ^ k1, a & mask]
            k0, k1 = (k0 + 0x9E3779B97F4A7C15) & mask, (k1 + 0xBB67AE8584CAA73B) & mask
        found += x
    return found


@pytest.mark.parametrize(
    ("seed", "key"), [(0, ()), (7, (3, 12)), (2**40, (1,)), ([5, 101, 9], ()), ([5, 101], (2,))]
)
def test_a_stream_is_that_of_its_seed_and_key(seed: int | list[int], key: tuple[int, ...]) -> None:
    state = SeedSequence(seed, spawn_key=key).generate_state(2, np.uint64)
    drawn = generator(seed, *key).bit_generator.random_raw(12)
    assert list(map(int, drawn)) == philox_words(state, 3)


def test_a_seed_without_a_key_is_the_plain_one_and_two_keys_are_two_streams() -> None:
    assert np.array_equal(generator(4).random(5), np.random.Generator(Philox(4)).random(5))
    usual = np.random.default_rng([4, 2]).random(5)
    assert np.array_equal(generator([4, 2], bits=PCG64).random(5), usual)
    assert len({float(generator(4, key).random()) for key in range(50)}) == 50


def test_no_other_place_makes_one() -> None:
    made = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if MADE.search(path.read_text("utf-8"))
    }
    assert made == set(OWN)
