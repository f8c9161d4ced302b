"""What the page shows on the table: the bodies, the plan, and the last push as it was predicted."""

from operator import is_not
from typing import Any, Final

import numpy as np
import viser

from sain_core.shapes.bodies import Bodies
from sain_core.view.scenes import bodies_in, plan_things, predictions, stage
from sain_core.view.things import GoalMark, Look, Thing
from sain_live.aims import FEASIBILITY
from sain_live.page.things import ThingsView, sky
from sain_live.state import LivePlan, LiveResult, LiveState

FEW: Final = 6  # other sequences that are shown, the cheapest


class SceneView:
    """Draws what is known of the scene, as far as it is new."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Draw the table."""
        server.scene.set_background_image(sky(256), format="png")
        self._view = ThingsView(server.scene)
        self._view.show("stage", stage(FEASIBILITY))
        self._shown: dict[str, tuple[Any, ...]] = {}

    def show(self, known: LiveState) -> None:
        """Draw what has changed."""
        seen, bodies = known.scene, known.bodies
        whole = seen is not None and len(bodies) == len(seen.disks)
        if seen is not None and whole and self._is_new("bodies", seen.disks, bodies):
            self._view.show_bodies(bodies_in(seen.disks, bodies))
        if self._is_new("plan", known.plan):
            plan = known.plan
            self._view.show("plan", [] if plan is None else _plan(known, plan))
        if self._is_new("result", known.result):
            result = known.result
            self._view.show("result", [] if result is None else _result(result, bodies))

    def _is_new(self, name: str, *now: object) -> bool:
        """Whether something is not what it was at the last call."""
        before, self._shown[name] = self._shown.get(name), now
        return before is None or any(map(is_not, before, now))


def _plan(known: LiveState, plan: LivePlan) -> list[Thing]:
    if len(plan.start) != len(known.bodies) or not len(plan.predicted):
        return []
    aim = known.aim
    goal = aim if aim is not None and max(aim.wanted) < len(known.bodies) else None
    made = plan_things(
        plan.start,
        known.bodies,
        goal,
        plan.pushes,
        plan.predicted,
        plan.regions,
        plan.places[np.argsort(plan.costs)[:FEW]],
    )
    return [thing for thing in made if not isinstance(thing, GoalMark)]  # `GoalsView` has them


def _result(result: LiveResult, bodies: Bodies) -> list[Thing]:
    if len(result.after) != len(bodies):
        return []
    before, after = result.before, result.after
    return [
        *predictions(before, after, result.physics, bodies, Look.PHYSICS),
        *predictions(before, after, result.planned, bodies, Look.EXPECTED),
    ]
