"""The first rows of the page's tables on real pushes, where SAIN_REAL_DATA names the folder."""

import os
from pathlib import Path

import numpy as np
import pytest

from benchmarks.real.kept import pose_errors
from benchmarks.real.physics import IdentifiedPhysics
from benchmarks.real.pushes import PushTable, read_pushes
from benchmarks.real.rows import Row, fixed_rows, published_rows
from benchmarks.real.trees import Trees

VARIABLE = "SAIN_REAL_DATA"

pytestmark = pytest.mark.skipif(
    VARIABLE not in os.environ, reason=f"{VARIABLE} does not name the public pushes"
)


@pytest.fixture(scope="module")
def pushes(tmp_path_factory: pytest.TempPathFactory) -> PushTable:
    return read_pushes(Path(os.environ[VARIABLE]), tmp_path_factory.mktemp("real"))


@pytest.fixture(scope="module")
def sample(pushes: PushTable) -> PushTable:
    """A fixed tenth of the groups of near repeats."""
    return pushes.select(pushes.group % 10 == 0)


@pytest.fixture(scope="module")
def others(pushes: PushTable) -> PushTable:
    """Ten pushes of each body on each surface, of other groups."""
    rest = pushes.select(pushes.group % 10 != 0)
    rows = (np.flatnonzero(rest.body == body) for body in np.unique(rest.body))
    spread = [mine[np.linspace(0, len(mine) - 1, 10).round().astype(int)] for mine in rows]
    return rest.select(np.sort(np.concatenate(spread)))


def errors(row: Row, others: PushTable, sample: PushTable) -> list[float]:
    """Mean errors [mm, degrees]."""
    nothing = others.select(np.zeros(0, dtype=int))
    found = row.fit(others, nothing).predict(sample)
    return [float(part.mean()) for part in pose_errors(found.poses, sample.after)]


def test_the_data_are_the_public_ones(pushes, sample):
    assert len(pushes) == 11272
    assert len(set(pushes.body.tolist())) == 22
    assert sorted(set(pushes.surface.tolist())) == ["abs", "plywood"]
    assert 1000 < len(sample) < 1250


def test_the_first_rows_of_the_table(others, sample, tmp_path):
    still, textbook = fixed_rows()[:2]
    mm, degrees = errors(still, others, sample)
    assert 20.0 < mm < 24.0
    assert 12.0 < degrees < 14.0
    second, fourth = (errors(row, others, sample)[0] for row in published_rows(sample))
    nominal, identified = (
        errors(row, others, sample) for row in (textbook, IdentifiedPhysics(tmp_path))
    )
    assert 3.3 < fourth < second < 4.1
    assert nominal[0] < 4.1
    assert nominal[1] < 5.4
    assert identified[0] < min(nominal[0], fourth)
    assert identified[1] < nominal[1]
    trees = errors(Trees(trees=30), others, sample)
    assert nominal[0] < trees[0] < 11.0  # so few pushes do not teach them physics
