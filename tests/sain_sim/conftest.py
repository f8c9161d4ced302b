import numpy as np
import pytest

from sain_core.push import PushLimits, make_push
from sain_core.randomness import generator
from sain_core.scene import unit, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.types import PushArray, Scene
from sain_sim.collecting.episode import draw_circle_push
from sain_sim.world.engines import BULLET, MUJOCO
from sain_sim.world.parameters import WorldParameters, nominal_parameters, sample_parameters
from sain_sim.world.start import draw_start
from sain_sim.world.workcell import WorldConfig
from sain_sim.world.world import World


class Bench:
    """Worlds and starts that the tests of the simulator share."""

    straight = make_push(0.0, 0.0, 0.1)

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
        return [draw_circle_push(random, scene, PAPER_DISKS) for _ in range(count)]

    @staticmethod
    def kick(world: World, body: int, velocity: tuple[float, float]) -> None:
        """Set the velocity [m/s] of a body."""
        cell = world._cell
        if world.engine == MUJOCO:
            cell._speeds[body, :2] = velocity
        else:
            world._simulation.client.resetBaseVelocity(cell.bodies[body].id, [*velocity, 0.0])

    @staticmethod
    def towards(heading: float, length: float = 0.1) -> PushArray:
        """A push through the mid disk's centre."""
        return PushLimits().check(make_push(float(wrap_angle(np.asarray(heading))), 0.0, length))


@pytest.fixture(scope="session")
def bench():
    return Bench()


@pytest.fixture(params=[BULLET, MUJOCO])
def engine(request):
    """Each engine in turn, for what is true of any world."""
    return request.param


@pytest.fixture
def world(engine):
    with World(nominal_parameters(), engine=engine) as world:
        yield world
