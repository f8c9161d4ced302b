"""Folds of real pushes: what is predicted was not learned from."""

import numpy as np
import pytest

from benchmarks.real.folds import Fold, all_cases, few_training, five_folds, left_out
from benchmarks.real.pushes import PushTable


@pytest.fixture(scope="module")
def pushes(synthetic_pushes: PushTable) -> PushTable:
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


def test_folds_follow_from_the_seed(pushes):
    first, same, other = (five_folds(pushes, seed).folds[0].test for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert set(first) != set(other)


def test_fewer_pushes_to_learn_from_are_a_part_of_the_folds(pushes):
    for few, whole in zip(
        few_training(pushes, 0, 20).folds, five_folds(pushes, 0).folds, strict=True
    ):
        assert len(few.train) == 20
        assert set(few.train) < set(whole.train)
        np.testing.assert_array_equal(few.test, whole.test)


@pytest.mark.parametrize("what", ["object", "surface"])
def test_what_is_left_out_is_known_from_own_pushes_alone(pushes, what):
    counts = (0, 2, 5)
    cases = left_out(pushes, 0, what, counts)
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


def test_own_pushes_are_nested(pushes):
    few, more = (left_out(pushes, 0, "object", (n, 5))[0].folds for n in (2, 5))
    for some, others in zip(few, more, strict=True):
        assert set(some.own) < set(others.own)


def test_pushes_with_one_surface_have_no_case_without_it(pushes):
    one = pushes.select(pushes.surface == "rubber")
    keys = [case.key for case in all_cases(one, 0)]
    assert "object_20" in keys
    assert not [key for key in keys if key.startswith("surface")]
