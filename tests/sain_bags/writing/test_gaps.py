"""What never came is counted where it can be, and never where it came after all."""

import pytest

from sain_bags.writing.gaps import Gaps
from sain_core.randomness import generator


def gaps_of(numbers: list[int], publishers: int = 1) -> Gaps:
    gaps = Gaps(lambda: publishers)
    for number in numbers:
        gaps.saw(number)
    return gaps


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [
        ([1, 2, 3], 0),
        ([7, 8, 9], 0),  # who joins late is not told what was before
        ([1, 2, 5, 6, 10], 5),
        ([], 0),
    ],
)
def test_one_publishers_gaps_are_exact(numbers: list[int], missing: int) -> None:
    gaps = gaps_of(numbers)
    assert (gaps.missing, gaps.is_exact, gaps.text()) == (missing, True, str(missing))


def test_of_several_publishers_never_more_is_told_than_is_missing() -> None:
    random = generator(3)
    found = 0
    for _ in range(50):
        next_numbers, numbers, lost = [1, 1, 1], [], 0
        for step in range(300):
            chosen = int(random.integers(3))
            if step > 20 and random.random() < 0.05:
                lost += 1
            else:
                numbers.append(next_numbers[chosen])
            next_numbers[chosen] += 1
        gaps = gaps_of(numbers, publishers=3)
        assert gaps.missing <= lost
        assert not gaps.is_exact
        assert gaps.text() == f">= {gaps.missing}"
        found += gaps.missing
    assert found > 0
