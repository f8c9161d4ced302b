"""A scenario: two disks side by side, and a goal straight ahead of the second."""

from dataclasses import dataclass

import numpy as np

from sain_core.goal import Goal
from sain_core.randomness import generator
from sain_core.scene import make_scene
from sain_eval.scenes.families import ScenarioScene


@dataclass(frozen=True)
class MyScenario:
    """Draws scenes: the same seed gives the same one."""

    name: str = "my_scenario"

    def scene(self, seed: int) -> ScenarioScene:
        """Draw places, friction and goal."""
        random = generator(seed, "scenario", self.name)
        places = np.array([(0.40, 0.0), (0.55, 0.0)]) + random.uniform(-0.02, 0.02, (2, 2))
        disks = make_scene(places, masses=np.full(2, 8.0), radii=np.array([0.07, 0.05]))
        goal = Goal.place(places[1, 0] + 0.15, places[1, 1])
        friction = float(random.uniform(0.1, 0.2))
        return ScenarioScene(self.name, seed, disks, friction, ("disk", "disk"), goal)


SCENARIO = MyScenario()
