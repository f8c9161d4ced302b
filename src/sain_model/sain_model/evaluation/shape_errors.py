"""Errors of physics and of SAIN on bodies of any shape: a row for each body of each push."""

from typing import Any, Final

import numpy as np

from sain_core.bootstrap import bootstrap_ratio
from sain_core.dataset import MOVED
from sain_core.model import Model
from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.seeding import generator
from sain_core.types import Mask, Scenes
from sain_model.data.dataset import Dataset
from sain_model.data.mixed import MixedDataset
from sain_model.data.shaped_physics import filter_for
from sain_model.dynamics.parameter_correction import ParameterCorrection
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.history_errors import earlier_friction, predict_with_history
from sain_model.physics.friction import FrictionFilter
from sain_model.physics.parameters import known_friction

LearnedModel = SainDynamics | ParameterCorrection
Rows = dict[str, np.ndarray]
PRIOR: Final = "prior"
SAIN_ROWS: Final = "sain"
PUSHED: Final = "pushed"
UNITS: Final = ("mm", "deg")


def shape_errors(data: MixedDataset | Dataset, sain: LearnedModel, seed: int = 0) -> dict[str, Any]:
    """Return the errors of a model on what it has not learned from, and those of its prior.

    Both know the same earlier pushes, where the model learns from them. "bodies" are groups of
    bodies, "shapes" the pushed bodies by their shape.
    """
    rows = measure_bodies(sain.filter or sain.prior, sain, data)
    return {
        "transitions": len(data),
        "episodes": len(np.unique(data.episode)),
        "bodies": _all_figures(rows, body_groups(rows), seed),
        "shapes": _all_figures(rows, shape_groups(rows), seed),
    }


def measure_bodies(
    physics: FrictionFilter | Model,
    sain: LearnedModel | None,
    data: MixedDataset | Dataset,
) -> Rows:
    """Return one row for each body of each push, of physics with a filter of friction or alone."""
    pieces: list[Rows] = []
    for part in data.parts:
        columns = {
            **_about(part),
            **_errors(PRIOR, predict_told(physics, part), part.next_state),
        }
        if isinstance(sain, ParameterCorrection):
            columns |= _errors(SAIN_ROWS, predict_told(sain, part), part.next_state)
        elif sain is not None:
            said = predict_with_history(sain, part)
            columns |= _errors(SAIN_ROWS, said.mean, part.next_state)
            if said.radius is not None:
                inside = columns["sain_mm"] <= 1e3 * said.radius
                columns |= {"inside": inside, "radius": said.radius}
        pieces.append({name: values.reshape(-1) for name, values in columns.items()})
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def predict_told(model: FrictionFilter | Model, part: Dataset) -> Scenes:
    """Return what a model says (M, N, 8).

    A filter's physics, and a parameter correction with one, have the friction that the episode's
    earlier pushes tell of.
    """
    if isinstance(model, FrictionFilter):
        told = filter_for(model, part.bodies)
        known = earlier_friction(told, part)
        return told.physics.step(part.state, part.action, {"friction": known.mean})
    if not isinstance(model, ParameterCorrection):
        return model.with_bodies(part.bodies).step(part.state, part.action)
    shaped = model.with_bodies(part.bodies)
    friction = earlier_friction(shaped.filter, part).mean if shaped.filter else None
    return shaped.step(part.state, part.action, known_friction(friction))


def _about(part: Dataset) -> Rows:
    """Return what is asked about each body of each push (M, N)."""
    shape = len(part), part.disks
    names = np.array([shape.name for shape in part.bodies.fitted(part.disks).shapes])
    return {
        "shape": np.broadcast_to(names, shape),
        "pushed": pushed_bodies(part.action)[:, None] == np.arange(part.disks),
        "alone": np.full(shape, part.disks == 1),
        "moved": np.linalg.norm((part.next_state - part.state)[..., POSITION], axis=-1),
        "episode": np.broadcast_to(part.episode[:, None], shape),
    }


def _errors(name: str, predicted: Scenes, truth: Scenes) -> Rows:
    """Return errors of position [mm] and heading [deg], (M, N)."""
    off = np.linalg.norm((predicted - truth)[..., POSITION], axis=-1)
    turned = np.abs(wrap_angle(predicted[..., THETA] - truth[..., THETA]))
    return {f"{name}_mm": 1e3 * off, f"{name}_deg": np.degrees(turned)}


def shape_groups(rows: Rows) -> dict[str, Mask]:
    """Return which rows are pushed bodies of each shape."""
    return {
        str(name): rows["pushed"] & (rows["shape"] == name) for name in sorted(set(rows["shape"]))
    }


def body_groups(rows: Rows) -> dict[str, Mask]:
    """Return which rows are pushed bodies, and which are bodies that others moved."""
    pushed, moved = rows["pushed"], rows["moved"] >= MOVED
    return {
        PUSHED: pushed,
        "pushed, alone": pushed & rows["alone"],
        "pushed, one of several": pushed & ~rows["alone"],
        "not pushed, moved": ~pushed & moved,
        "all that moved": moved,
    }


def _all_figures(rows: Rows, groups: dict[str, Mask], seed: int) -> dict[str, dict[str, Any]]:
    return {
        name: figures({key: values[chosen] for key, values in rows.items()}, seed)
        for name, chosen in groups.items()
        if chosen.any()
    }


def figures(rows: Rows, seed: int = 0) -> dict[str, Any]:
    """Return mean errors of these rows, their ratios with intervals over episodes, and coverage."""
    found: dict[str, Any] = {"pushes": len(rows["episode"])}
    for unit in UNITS:
        prior = rows[f"{PRIOR}_{unit}"]
        found[f"{PRIOR}_{unit}"] = float(prior.mean())
        if f"{SAIN_ROWS}_{unit}" in rows:
            sain = rows[f"{SAIN_ROWS}_{unit}"]
            found[f"{SAIN_ROWS}_{unit}"] = float(sain.mean())
            found[f"ratio_{unit}"] = bootstrap_ratio(
                sain, prior, generator(seed, "ratio"), rows["episode"]
            )
    if "inside" in rows:
        found["coverage"] = float(rows["inside"].mean())
    return found
