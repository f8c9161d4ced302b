"""Ranges of ids are the same set as the ids."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sain_bags.transitions.id_ranges import IdRanges


@given(st.lists(st.integers(0, 30)))
def test_it_is_a_set_with_as_few_ranges_as_there_can_be(numbers: list[int]) -> None:
    ranges, plain = IdRanges(), set(numbers)
    for number in numbers:
        ranges.add(number)
    assert [number in ranges for number in range(-1, 32)] == [n in plain for n in range(-1, 32)]
    assert len(ranges) == sum(number - 1 not in plain for number in plain)


@given(st.lists(st.sets(st.integers(0, 30), min_size=1)))
def test_many_at_once_are_the_same_set(parts: list[set[int]]) -> None:
    ranges, plain = IdRanges(), set[int]()
    for part in parts:
        if new := part - plain:
            ranges.add_all(np.array(sorted(new)[::-1], dtype=np.uint64))
        plain |= part
        numbers = np.arange(33, dtype=np.uint64)
        assert ranges.holds(numbers).tolist() == [number in plain for number in range(33)]
        assert len(ranges) == sum(number - 1 not in plain for number in plain)


def test_counting_up_takes_one_range() -> None:
    ranges = IdRanges()
    for number in range(1 << 40, (1 << 40) + 1000):
        ranges.add(number)
    assert len(ranges) == 1
