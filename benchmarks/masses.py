"""How far pushes reveal the masses of two disks, and what it costs not to measure them.

    ros2 run sain_sim collect --parameters wide --seed 77 --episodes 120 --out data/masses
    python -m benchmarks.masses data/masses

A tool that moves as commanded shows ratios of masses only. The ratio of mid disk to target and the
friction with the table are inferred from the earlier pushes of the episode on a grid, with the
likelihood of `sain_model.physics.friction`. Radii are the true ones.
"""

from pathlib import Path
from typing import Annotated, Final

import numpy as np
import tyro
from jaxtyping import Float
from numpy import ndarray

from sain_core.dataset import MOVED
from sain_core.scene import MASS, MID, POSITION, TARGET
from sain_core.seeding import generator
from sain_core.types import Scalars, Scenes
from sain_model.data.dataset import Dataset, load_transitions
from sain_model.evaluation.markdown import markdown_table
from sain_model.physics.friction import FrictionConfig
from sain_model.physics.planar import NOMINAL_MASS, PlanarPrior
from sain_model.physics.planar_config import AXES

RATIOS: Final = np.linspace(-np.log(4.0), np.log(4.0), 41)  # logarithms, of mid disk to target
FRICTIONS: Final = np.log(AXES.friction) + np.linspace(-np.log(4.0), np.log(4.0), 41)
EQUAL: Final = len(RATIOS) // 2  # where both masses are the same
WIDTH: Final = 0.5  # of what is believed of both beforehand, standard deviation of the logarithm
KNOWN: Final = ((0, 0), (1, 1), (2, 2), (3, 9))  # earlier pushes that moved the target
RESAMPLES: Final = 2000
CONFIG: Final = FrictionConfig()

Grid = Float[ndarray, "M G F"]  # of pushes: ratios, frictions


def main(dataset: Annotated[Path, tyro.conf.Positional]) -> None:
    """Print errors of predictions and of the ratio, by the number of telling pushes."""
    data = load_transitions(dataset)
    print(f"all masses scaled by 1.5: predictions change by {1e3 * _scaled_change(data):.1g} mm\n")
    likelihood = _log_likelihood(data)
    true = np.log(data.state[:, MID, MASS] / data.state[:, TARGET, MASS])
    place = np.abs(RATIOS - true[:, None]).argmin(axis=1)
    equal = np.full((1, len(RATIOS), 1), -np.inf)
    known = np.full((len(true), len(RATIOS), 1), -np.inf)
    equal[:, EQUAL] = 0.0
    known[np.arange(len(true)), place] = 0.0
    ways = {"equal": equal, "inferred": -0.5 * (RATIOS[:, None] / WIDTH) ** 2, "true": known}
    moved = _way(data.next_state, data.state) >= MOVED
    telling = np.array([moved[earlier].sum() for earlier in _earlier(data)])
    errors, ratios = {}, true
    for name, before in ways.items():
        found, friction = _means(data, likelihood, before)
        errors[name] = _way(_predict(data, found, np.exp(friction)), data.next_state)
        ratios = found if name == "inferred" else ratios
    rows = []
    for low, high in KNOWN:
        chosen = moved & (telling >= low) & (telling <= high)
        off = np.exp(np.abs(ratios - true)[chosen].mean()) - 1.0
        share = _interval(errors["inferred"][chosen], errors["equal"][chosen], data.episode[chosen])
        name = f"{low} to {high}" if high > low else str(low)
        rows.append(
            [name, str(chosen.sum()), f"{100 * off:.0f} %"]
            + [f"{1e3 * errors[way][chosen].mean():.2f}" for way in ways]
            + [f"{share[0]:.2f} [{share[1]:.2f}, {share[2]:.2f}]"]
        )
    header = ("telling pushes before", "pushes", "ratio off by", *(f"{way}, mm" for way in ways))
    print(markdown_table((*header, "inferred / equal"), rows))


def _earlier(data: Dataset) -> list[ndarray]:
    """Return for each push which others (M,) of its episode came before it."""
    rows = zip(data.episode, data.step, strict=True)
    return [(data.episode == episode) & (data.step < step) for episode, step in rows]


def _means(data: Dataset, likelihood: Grid, before: ndarray) -> tuple[Scalars, Scalars]:
    """Return the means of both logarithms (M,) that earlier pushes and a belief lead to."""
    friction = -0.5 * ((FRICTIONS - np.log(AXES.friction)) / WIDTH) ** 2
    log = np.stack([likelihood[earlier].sum(axis=0) for earlier in _earlier(data)])
    log += before + friction
    weights = np.exp(log - log.max(axis=(1, 2), keepdims=True))
    weights /= weights.sum(axis=(1, 2), keepdims=True)
    return weights.sum(axis=2) @ RATIOS, weights.sum(axis=1) @ FRICTIONS


def _predict(data: Dataset, log_ratio: Scalars, friction: Scalars) -> Scenes:
    scenes = data.state.copy()
    scenes[:, MID, MASS] = NOMINAL_MASS * np.exp(0.5 * log_ratio)
    scenes[:, TARGET, MASS] = NOMINAL_MASS * np.exp(-0.5 * log_ratio)
    return PlanarPrior(AXES).step(scenes, data.action, friction)


def _way(scenes: Scenes, others: Scenes, body: int = TARGET) -> Scalars:
    return np.asarray(np.linalg.norm((scenes - others)[:, body, POSITION], axis=-1))


def _log_likelihood(data: Dataset) -> Grid:
    """Return the log likelihood of each push at each ratio and friction."""
    count = len(data.action)
    total = np.zeros((count, len(RATIOS), len(FRICTIONS)))
    for row, ratio in enumerate(RATIOS):
        for column, friction in enumerate(np.exp(FRICTIONS)):
            predicted = _predict(data, np.full(count, ratio), np.full(count, friction))
            for body in (MID, TARGET):
                off = _way(predicted, data.next_state, body)
                scale = CONFIG.noise + CONFIG.noise_share * _way(data.next_state, data.state, body)
                odds = np.log1p((off / scale) ** 2 / CONFIG.tail)
                total[:, row, column] -= 0.5 * (CONFIG.tail + 2.0) * odds
    return total


def _scaled_change(data: Dataset) -> float:
    """Return the largest change [m] of a prediction when all masses are scaled together."""
    heavier, prior = data.state.copy(), PlanarPrior(AXES)
    heavier[..., MASS] *= 1.5
    ends = [prior.step(scenes, data.action, data.friction) for scenes in (data.state, heavier)]
    return float(np.abs(ends[0] - ends[1])[..., POSITION].max())


def _interval(errors: Scalars, others: Scalars, episodes: ndarray) -> tuple[float, float, float]:
    """Return the ratio of two mean errors with its 95 % bootstrap interval over episodes."""
    names, place = np.unique(episodes, return_inverse=True)
    sums = np.stack([np.bincount(place, some, len(names)) for some in (errors, others)])
    draws = generator(0, "masses").integers(0, len(names), (RESAMPLES, len(names)))
    ratios = sums[0][draws].sum(axis=1) / sums[1][draws].sum(axis=1)
    low, high = np.quantile(ratios, [0.025, 0.975])
    return float(errors.mean() / others.mean()), float(low), float(high)


if __name__ == "__main__":
    tyro.cli(main)
