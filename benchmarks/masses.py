"""How far pushes reveal the masses of two disks, and what it costs not to measure them.

    ros2 run sain_sim collect --parameters wide --seed 77 --episodes 120 --out data/masses
    python -m benchmarks.masses data/masses

The shipped model predicts each push from the earlier pushes of its episode, in three ways: with the
nominal masses for the true ones, with the ratio inferred, and with the true masses. Friction is
unknown in all of them, and radii are the true ones.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import tyro
from numpy import ndarray

from sain_core.dataset import MOVED
from sain_core.model import load_dynamics
from sain_core.scene import MASS, MID, POSITION, TARGET
from sain_core.seeding import generator
from sain_core.types import Mask, Scalars, Scenes
from sain_model.data.dataset import Part, load_dataset
from sain_model.dynamics.intervals import Prediction
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.named_models import NOMINAL_MASS
from sain_model.evaluation.tables import markdown_table
from sain_model.inference.evidence import Known
from sain_model.inference.kinds import MASS_RATIO
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import AXES

KNOWN: Final = ((0, 0), (1, 1), (2, 2), (3, 3), (4, 9))  # earlier pushes that moved the target
RESAMPLES: Final = 2000
WAYS: Final = ("nominal", "inferred", "true")


def main(dataset: Annotated[Path, tyro.conf.Positional], model: str = "sain") -> None:
    """Print errors of predictions and of the ratio, by the number of telling pushes."""
    data, dynamics = load_dataset(dataset).alike, load_dynamics(model)
    assert isinstance(dynamics, SainDynamics)
    print(f"all masses scaled by 1.5: predictions change by {1e3 * _scaled_change(data):.1g} mm\n")
    nominal = replace(data, state=_nominal(data.state), next_state=_nominal(data.next_state))
    asked = (dynamics, nominal), (dynamics.with_unknown_masses(), nominal), (dynamics, data)
    known = Known.earlier(data.episode, data.step)
    inferred = [some.infer(seen.observed, known) for some, seen in asked]
    predicted = [
        some.predict_rows(seen.state, seen.action, rows)
        for (some, seen), rows in zip(asked, inferred, strict=True)
    ]
    belief, posterior = asked[1][0].belief, inferred[1].posterior
    off = np.abs(np.log(posterior.values(belief, MASS_RATIO)) - _log_ratio(data))
    stated = posterior.log_spread(belief, MASS_RATIO)
    errors = [_way(one.mean, data.next_state) for one in predicted]
    moved = _way(data.next_state, data.state) >= MOVED
    telling = np.array([moved[earlier].sum() for earlier in _earlier(data)])
    rows = []
    for low, high in KNOWN:
        chosen = moved & (telling >= low) & (telling <= high)
        share = _interval(errors[1][chosen], errors[0][chosen], data.episode[chosen])
        held = [_held(one, way)[chosen].mean() for one, way in zip(predicted, errors, strict=True)]
        rows.append(
            [f"{low} to {high}" if high > low else str(low), str(chosen.sum())]
            + [_percent(some[chosen].mean()) for some in (off, stated)]
            + [f"{1e3 * some[chosen].mean():.2f}" for some in errors]
            + [f"{share[0]:.2f} [{share[1]:.2f}, {share[2]:.2f}]"]
            + [" / ".join(f"{100 * part:.0f}" for part in held) + " %"]
        )
    header = ("telling pushes before", "pushes", "ratio off by", "stated", *WAYS)
    print(markdown_table((*header, "inferred / nominal", "regions hold"), rows))


def _percent(logarithm: float) -> str:
    return f"{100 * np.expm1(logarithm):.0f} %"


def _held(predicted: Prediction, off: Scalars) -> Mask:
    """Return which targets (M,) end inside their regions."""
    assert predicted.radius is not None
    return np.asarray(off <= predicted.radius[:, TARGET])


def _nominal(scenes: Scenes) -> Scenes:
    seen = scenes.copy()
    seen[..., MASS] = NOMINAL_MASS
    return seen


def _log_ratio(data: Part) -> Scalars:
    """Return the logarithm of the true ratio of target to mid disk (M,)."""
    return np.asarray(np.log(data.state[:, TARGET, MASS] / data.state[:, MID, MASS]))


def _earlier(data: Part) -> list[ndarray]:
    """Return for each push which others (M,) of its episode came before it."""
    rows = zip(data.episode, data.step, strict=True)
    return [(data.episode == episode) & (data.step < step) for episode, step in rows]


def _way(scenes: Scenes, others: Scenes) -> Scalars:
    return np.asarray(np.linalg.norm((scenes - others)[:, TARGET, POSITION], axis=-1))


def _scaled_change(data: Part) -> float:
    """Return the largest change [m] of a prediction when all masses are scaled together."""
    heavier, prior = data.state.copy(), PlanarPrior(AXES)
    heavier[..., MASS] *= 1.5
    known = {"friction": data.friction}
    ends = [prior.step(scenes, data.action, known) for scenes in (data.state, heavier)]
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
