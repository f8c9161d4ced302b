"""What is learned from and what is predicted: folds of the pushes, drawn with one printed seed.

Near repeats of a push have one group and are never divided: no push is predicted by a model that
learned from a repeat of it, be it at another speed or on another surface. Only where a surface is
left out, models learn from the same pushes on the others: that is what they know there.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from benchmarks.real.pushes import PushTable
from sain_core.randomness import generator
from sain_core.types import Indices, Mask

FOLDS: Final = 5
OWN: Final = (0, 1, 2, 5, 10, 20, 50, 100)  # pushes of a body that nothing else is known of
FEW_OWN: Final = (0, 20)  # of them, for rows that learn anew
MOST_OWN: Final = 0.4  # share of the pushes of a body: the others are predicted
USUAL: Final = 20  # of them, where one number is shown
SIZES: Final = (300, 1000, 3000)  # pushes to learn from


@dataclass(frozen=True, eq=False)
class Fold:
    """One division of the pushes.

    Attributes:
        name: what is special about it, for people and for files.
        train: numbers of the pushes to learn from, rising.
        own: of a few pushes of the bodies that are left out; none: nothing is left out.
        test: of the pushes to predict.
    """

    name: str
    train: Indices
    own: Indices
    test: Indices


@dataclass(frozen=True, eq=False)
class Case:
    """What is asked: folds whose predictions make one table.

    Attributes:
        key: name in files and results.
        title: above the table.
        folds: of which no two predict the same push.
        for_all: whether rows take part for which own pushes cost a whole training.
    """

    key: str
    title: str
    folds: tuple[Fold, ...]
    for_all: bool = True


def all_cases(pushes: PushTable, seed: int) -> list[Case]:
    """Return all cases; those that the data cannot have, as of one surface, are left out."""
    fewest = int(np.unique(pushes.body, return_counts=True)[1].min())
    own = tuple(count for count in OWN if count <= MOST_OWN * fewest)
    return [
        five_folds(pushes, seed),
        *(few_training(pushes, seed, size) for size in SIZES if size < len(pushes) // 2),
        *left_out(pushes, seed, "object", own),
        *left_out(pushes, seed, "surface", tuple(n for n in (0, USUAL) if n in own)),
    ]


def five_folds(pushes: PushTable, seed: int) -> Case:
    """Return folds of groups of near repeats."""
    return Case("folds", f"{FOLDS} folds", tuple(_folds(pushes, seed)))


def few_training(pushes: PushTable, seed: int, size: int) -> Case:
    """Return the same folds with so many pushes to learn from, of groups drawn at random."""
    folds = []
    for fold in _folds(pushes, seed):
        order = generator(seed, "few", fold.name).permutation(len(fold.train))
        kept = np.sort(fold.train[order[:size]])
        folds.append(Fold(fold.name, kept, fold.own, fold.test))
    return Case(f"train_{size}", f"{size:,} pushes to learn from", tuple(folds))


def _folds(pushes: PushTable, seed: int) -> Iterator[Fold]:
    groups, place = np.unique(pushes.group, return_inverse=True)
    fold_of = np.empty(len(groups), dtype=np.int64)
    fold_of[generator(seed, "folds").permutation(len(groups))] = np.arange(len(groups)) % FOLDS
    nothing = np.zeros(0, dtype=np.int64)
    for number in range(FOLDS):
        held = fold_of[place] == number
        yield Fold(str(number + 1), np.flatnonzero(~held), nothing, np.flatnonzero(held))


def left_out(pushes: PushTable, seed: int, what: str, counts: tuple[int, ...]) -> list[Case]:
    """Return, for each number of own pushes, the case that leaves out each object or each surface.

    All of them predict the same pushes: those without a near repeat among the most own pushes.
    """
    names = getattr(pushes, what)
    if len(np.unique(names)) < 2:
        return []
    cases = []
    for count in counts:
        folds = tuple(
            _left_out(pushes, seed, names == name, str(name), count, max(counts))
            for name in np.unique(names)
        )
        title = f"each {what} left out, {count} own pushes of each body"
        cases.append(Case(f"{what}_{count}", title, folds, count in FEW_OWN))
    return cases


def _left_out(pushes: PushTable, seed: int, out: Mask, name: str, count: int, most: int) -> Fold:
    order = _own_order(pushes, seed, out, name)
    own, reserved = (first_of_each_body(pushes, order, number) for number in (count, most))
    held = out & ~np.isin(pushes.group, pushes.group[reserved])
    return Fold(name, np.flatnonzero(~out), np.sort(own), np.flatnonzero(held))


def _own_order(pushes: PushTable, seed: int, out: Mask, name: str) -> Int[ndarray, "P"]:
    """Return the left-out pushes in the order in which they become known: group by group."""
    rows = np.flatnonzero(out)
    groups, place = np.unique(pushes.group[rows], return_inverse=True)
    rank = generator(seed, "own", name).permutation(len(groups))
    return rows[np.argsort(rank[place], kind="stable")]


def first_of_each_body(pushes: PushTable, order: Indices, count: int) -> Indices:
    """Return the first so many of each body, of pushes in an order."""
    bodies = pushes.body[order]
    return np.concatenate([order[bodies == body][:count] for body in np.unique(bodies)])
