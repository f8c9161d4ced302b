"""The models that predict each push of a laboratory, by name, and how far off they are."""

import numpy as np

from sain_core.errors import CheckpointError, InvalidInputError
from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.transitions import MOVED, PushHistory
from sain_core.types import Scene
from sain_lab.judging.judge import RECENT
from sain_lab.serving import load_service
from sain_lab.state import State
from sain_lab.storage.laboratory import PHYSICS, PLANAR, SHIPPED, Laboratory
from sain_lab.storage.results import Result
from sain_model.dynamics.sain import SainDynamics

Errors = tuple[float, float]  # of places [mm] and of headings [degrees]


class Contenders:
    """The physics as it is believed, what it is compared with, and the laboratory's networks."""

    def __init__(self, laboratory: Laboratory, shipped: SainDynamics, state: State) -> None:
        self._laboratory, self._state = laboratory, state
        self._models = {SHIPPED: shipped}

    def model(self, name: str) -> SainDynamics:
        """Return a contender for an episode that begins; raises `CheckpointError`."""
        if name == PHYSICS:
            return self._state.believer.model
        if name not in self._models:
            self._models[name] = load_service(self._laboratory, name)
        return self._models[name]

    def errors(self, name: str, result: Result, history: PushHistory) -> Errors | None:
        """Return the errors of a contender on a push; None: it predicts none such.

        Bodies that have names are predicted by their own physics and by planar physics alone.
        Raises `SainError`: it should predict it, and does not.
        """
        model: SainDynamics | None
        if result.object and name != PLANAR:
            model = self._state.bodies.model(result) if name == PHYSICS else None
        elif name == RECENT:
            model = self._state.believer.recent(self._state.recent)
        else:
            model = self.model(name)
        return None if model is None else error_of(model, result, history)

    def has_network(self, name: str) -> bool:
        """Return True if a network was written whole."""
        try:
            self.model(name)
        except CheckpointError:
            return False
        return True

    def forget(self, name: str) -> None:
        """Forget a network."""
        self._models.pop(name, None)


def error_of(model: SainDynamics, result: Result, history: PushHistory) -> Errors:
    """Return the errors of a model on a push; raises `SainError`: it does not predict it."""
    conditioned = model.with_bodies(result.own_bodies).condition(history)
    after = conditioned.step(result.before[None], result.push[None])[0]
    if not np.isfinite(after).all():
        raise InvalidInputError("the prediction has NaN or Inf")
    return prediction_error(after, result)


def prediction_error(after: Scene, result: Result) -> Errors:
    """Return the mean errors of the bodies that were pushed or moved.

    Moved has a body that ends 2 mm or more from where it was, in truth.
    """
    moved = np.hypot(*(result.after - result.before)[:, POSITION].T) >= MOVED
    moved[pushed_bodies(result.push[None])[0]] = True
    off = after[moved] - result.after[moved]
    places = 1e3 * np.hypot(*off[:, POSITION].T)
    turns = np.degrees(np.abs(wrap_angle(off[:, THETA])))
    return float(places.mean()), float(turns.mean())
