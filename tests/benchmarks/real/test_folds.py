"""Folds of real pushes: what is predicted was not learned from."""

import numpy as np
import pytest

from benchmarks.real.folds import Fold, five_folds, left_out
from benchmarks.real.pushes import PushTable


@pytest.fixture(scope="module")
def pushes(synthetic_pushes):
    return synthetic_pushes


def groups_of(pushes: PushTable, rows: np.ndarray) -> set[int]:
    return set(pushes.group[rows].tolist())


def learned(fold: Fold) -> np.ndarray:
    return np.concatenate([fold.train, fold.own])


def test_five_folds_predict_every_push_once_and_divide_no_group(pushes):
    folds = five_folds(pushes, seed=3).folds
    tested = np.concatenate([fold.test for fold in folds])
    assert sorted(tested) == list(range(len(pushes)))
    for fold in folds:
        assert not groups_of(pushes, learned(fold)) & groups_of(pushes, fold.test)
        assert len(fold.train) + len(fold.test) == len(pushes)


@pytest.mark.parametrize("what", ["object", "surface"])
def test_what_is_left_out_is_known_from_own_pushes_alone(pushes, what):
    counts = (0, 2, 5)
    cases = left_out(pushes, 0, what, counts)
    for few, more in zip(cases[1].folds, cases[2].folds, strict=True):
        assert set(few.own) < set(more.own)
    names = getattr(pushes, what)
    for count, case in zip(counts, cases, strict=True):
        for fold, first in zip(case.folds, cases[0].folds, strict=True):
            assert set(names[fold.test]) == set(names[fold.own]) | {fold.name} == {fold.name}
            assert fold.name not in set(names[fold.train])
            assert not groups_of(pushes, fold.own) & groups_of(pushes, fold.test)
            np.testing.assert_array_equal(fold.test, first.test)  # numbers can be compared
            bodies, numbers = np.unique(pushes.body[fold.own], return_counts=True)
            assert not count or len(bodies) == len(set(pushes.body[names == fold.name]))
            assert set(numbers.tolist()) <= {count}
