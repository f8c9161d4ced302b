import numpy as np
import pytest

from sain_core.push import PushLimits
from sain_core.scene import unit, wrap_angle
from sain_core.seeding import generator
from sain_core.types import PushArray, Scene
from sain_sim.episodes.samplers import CircleSampler
from sain_sim.episodes.start import draw_start
from sain_sim.world.parameters import WorldParameters, nominal_parameters, sample_parameters
from sain_sim.world.workcell import WorldConfig
from sain_sim.world.world import World


class Bench:
    """Worlds and starts that the tests of the simulator share."""

    straight = np.array([0.0, 0.0, 0.1])

    @staticmethod
    def touching(parameters: WorldParameters | None = None, bearing: float = 0.0) -> Scene:
        """A mid disk with the target 1 mm off it, further disks well out of the way."""
        parameters = parameters or nominal_parameters()
        mid = np.array([0.42, 0.0])
        target = mid + (sum(parameters.radii[:2]) + 0.001) * unit(np.asarray(bearing))
        others = [[0.35 + 0.2 * i, 0.4] for i in range(parameters.count - 2)]
        return parameters.scene(np.vstack([mid, target, *others]))

    @staticmethod
    def drawn(seed: int, count: int = 2) -> tuple[WorldParameters, Scene]:
        """A randomised world and a start in it."""
        random = generator(seed, "test")
        parameters = sample_parameters(random, count)
        table = WorldConfig().feasibility.table
        return parameters, draw_start(random, parameters, table)

    @staticmethod
    def pushes(seed: int, scene: Scene, count: int) -> list[PushArray]:
        """Pushes, half of them aimed through the target of this scene."""
        random = generator(seed, "pushes")
        return [CircleSampler().draw(random, scene) for _ in range(count)]

    @staticmethod
    def towards(heading: float, length: float = 0.1) -> PushArray:
        """A push through the mid disk's centre."""
        return PushLimits().check(np.array([float(wrap_angle(np.asarray(heading))), 0.0, length]))


@pytest.fixture(scope="session")
def bench() -> Bench:
    return Bench()


@pytest.fixture
def world():
    with World(nominal_parameters()) as world:
        yield world
