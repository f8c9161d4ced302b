"""What never came is counted where it can be, and never where it came after all."""

import pytest

from sain_bags.writing.gaps import MISSING_KEY, Gaps, describe_gaps, read_gaps
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


def test_several_publishers_without_loss_have_no_gaps() -> None:
    random = generator(2)
    for _ in range(50):
        count = int(random.integers(2, 5))
        next_numbers = random.integers(1, 400, size=count)
        numbers = []
        for _ in range(300):
            chosen = int(random.integers(count))
            numbers.append(int(next_numbers[chosen]))
            next_numbers[chosen] += 1
        gaps = gaps_of(numbers, publishers=count)
        assert gaps.missing == 0


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


def test_a_publisher_that_starts_anew_counts_from_one() -> None:
    gaps = gaps_of([1, 2, 3, 1, 2, 6])
    assert gaps.missing == 2  # 4 and 5 of the first; of the second they would be three
    assert not gaps.is_exact


def test_messages_without_numbers_tell_nothing() -> None:
    assert gaps_of([0, 0]).text() == "?"


def test_a_bag_tells_of_topics_with_gaps_only() -> None:
    told = describe_gaps({"/a": gaps_of([1, 2]), "/b": gaps_of([1, 4]), "/c": gaps_of([0])})
    assert read_gaps({MISSING_KEY: told}) == {"/b": "2", "/c": "?"}
    assert read_gaps({}) is None
    assert read_gaps({MISSING_KEY: "nonsense"}) is None
