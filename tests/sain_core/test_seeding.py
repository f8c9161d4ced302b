import subprocess
import sys

import numpy as np
import pytest

from sain_core.randomness import generator


def test_the_same_seed_and_path_give_the_same_bytes_in_another_process() -> None:
    use = "from sain_core.randomness import generator"
    code = f"{use};print(generator(7, 'collect', 12).bytes(32).hex())"
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert there.stdout.split()[-1] == generator(7, "collect", 12).bytes(32).hex()


@pytest.mark.parametrize("other", [(8, "collect", 12), (7, "collect", 13), (7, "train", 12), (7,)])
def test_another_seed_or_path_gives_other_bytes(other: tuple) -> None:
    assert generator(*other).bytes(32) != generator(7, "collect", 12).bytes(32)


def test_neighbouring_paths_are_uncorrelated() -> None:
    draws = np.stack([generator(1, "world", i).normal(size=2000) for i in range(8)])
    correlation = np.corrcoef(draws) - np.eye(8)
    assert np.abs(correlation).max() < 0.1


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="seed is -1"):
        generator(-1)
