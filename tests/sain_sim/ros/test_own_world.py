"""A stranger's world in the simulator's node: its pushes are answered, and its failures told."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest

from sain_core.errors import ErrorCode
from sain_core.world import Outcome
from sain_sim.ros.sim_node import SimNode
from sain_sim.world.engines import OFFERED

AHEAD = (0.0, 0.0, 0.1)


class Fragile:
    """A world in which the first push fails and the others move nothing."""

    pushes = 0

    def reset(self, start):
        self.scene = start.scene
        return self.observe()

    def observe(self):
        return self.scene.copy()

    def push(self, push, *, seen=None):
        self.pushes += 1
        after = self.scene * np.nan if self.pushes == 1 else self.observe()
        return Outcome(self.observe(), after)


def load(name: str) -> Fragile:
    return Fragile()


@pytest.fixture
def simulator(graph, monkeypatch):
    entry = EntryPoint("fragile", f"{__name__}:load", OFFERED.group)
    monkeypatch.setattr(OFFERED, "entries", lambda: {"fragile": [entry]})
    node = graph.start(SimNode, idle_rate=20.0, engine="fragile", shadow=False)
    graph.wait(lambda: graph.find("scene", settled=True), "a settled scene")
    return node


def test_a_push_that_the_world_breaks_is_refused_with_one_line(graph, simulator):
    scene = graph.find("scene", settled=True)[-1]
    graph.push(scene, 1, AHEAD)
    refused = graph.result(1)
    assert ErrorCode(refused.error_code) is ErrorCode.INTERNAL
    assert refused.error_message.startswith("engine 'fragile' of ")
    assert "push: body 0 has NaN or Inf; allowed: finite numbers" in refused.error_message
    assert refused.after.scene_id == scene.scene_id  # nothing has moved
    graph.push(scene, 2, AHEAD)
    assert graph.result(2).error_code == ErrorCode.OK
    assert not simulator.driver.reception.figures["defects"]
