import subprocess
import sys

import numpy as np
import pytest

from sain_core.randomness import bootstrap_mean, bootstrap_ratio, generator


def test_the_same_seed_and_path_give_the_same_bytes_in_another_process():
    use = "from sain_core.randomness import generator"
    code = f"{use};print(generator(7, 'collect', 12).bytes(32).hex())"
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert there.stdout.split()[-1] == generator(7, "collect", 12).bytes(32).hex()


def test_the_bootstrap_holds_the_mean_and_shrinks_with_more_values():
    values = generator(0).normal(5.0, 1.0, 400)
    few, many = (bootstrap_mean(values[:n], generator(1)) for n in (20, 400))
    assert many.low < many.estimate < many.high
    assert many.estimate == pytest.approx(values.mean())
    assert many.high - many.low < 0.5 * (few.high - few.low)
    assert many.high - many.low == pytest.approx(2 * 1.96 / 20, rel=0.2)


def test_a_ratio_of_means_varies_with_the_groups_and_not_within_one():
    groups = np.repeat(np.arange(8), 5)
    below = np.random.default_rng(0).uniform(1.0, 2.0, len(groups))
    same = bootstrap_ratio(3.0 * below, below, generator(0), groups)
    assert same == pytest.approx((3.0, 3.0, 3.0))
    above = below * np.repeat(np.linspace(1.0, 2.0, 8), 5)
    ratio, low, high = bootstrap_ratio(above, below, generator(0), groups)
    assert ratio == pytest.approx(above.sum() / below.sum())
    assert 1.0 < low < ratio < high < 2.0
    ones = np.ones(len(groups))
    assert bootstrap_ratio(above, ones, generator(0), groups) == bootstrap_mean(
        above, generator(0), groups
    )
