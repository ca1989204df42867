"""The cache of maps: each made once, and never more memory than it may have."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import pytest
import torch

from shotenv.dataset.map_cache import MapCache, nbytes_of


@dataclass(frozen=True)
class Maps:
    depth_m: torch.Tensor
    others: tuple[torch.Tensor, ...]
    name: str = "maps"


def test_bytes_are_those_of_all_tensors():
    maps = Maps(torch.zeros(2, 3), (torch.zeros(5, dtype=torch.bool), torch.zeros(1).double()))
    assert nbytes_of(maps) == 24 + 5 + 8
    assert nbytes_of("no tensor") == 0


def test_what_was_used_longest_ago_is_given_up():
    made = []

    def compute(number):
        made.append(number)
        return torch.full((250,), float(number))  # 1000 bytes

    cache = MapCache(compute, largest_mb=0.003)
    for number in (0, 1, 2, 0, 3):  # 1 is the one used longest ago
        assert cache(number)[0] == number
    assert made == [0, 1, 2, 3] and cache.nbytes == 3000
    assert cache(0)[0] == 0 and made == [0, 1, 2, 3]
    assert cache(1)[0] == 1 and made == [0, 1, 2, 3, 1]


def test_what_is_larger_than_the_cache_is_not_kept():
    cache = MapCache(torch.zeros, largest_mb=0.001)
    assert len(cache(1000)) == 1000 and cache.nbytes == 0


def test_threads_share_a_cache():
    cache = MapCache(lambda number: torch.full((250,), float(number)), largest_mb=0.005)
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(cache, [number % 9 for number in range(900)]))
    assert all((maps == number % 9).all() for number, maps in enumerate(found))
    assert cache.nbytes == 5000


def test_an_error_is_not_remembered():
    answers = iter([ValueError("once"), torch.ones(1)])

    def compute():
        answer = next(answers)
        if isinstance(answer, Exception):
            raise answer
        return answer

    cache = MapCache(compute, largest_mb=1)
    with pytest.raises(ValueError, match="once"):
        cache()
    assert cache() == 1
