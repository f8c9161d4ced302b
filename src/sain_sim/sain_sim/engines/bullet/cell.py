"""A world in Bullet: one client, emptied and filled again for every push."""

from typing import Final

from sain_core.types import Mask, Scene
from sain_sim.arm.client import Client
from sain_sim.arm.panda import ArmConfig, PandaModel
from sain_sim.engines.bullet.arm import Arm
from sain_sim.engines.bullet.bodies import BodyState, resting
from sain_sim.engines.bullet.stage import Stage
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.workcell import GRAVITY, Origin, Simulation, Workcell, WorldConfig

CONTACT_BREAKING: Final = 0.001  # [m]; Bullet's 0.02 keeps contacts of rims that slid apart


class BulletSimulation(Simulation):
    """A physics server, and the descriptions of the arms that it loads."""

    def __init__(self, config: WorldConfig) -> None:
        """Connect to a server of its own."""
        super().__init__(config)
        self.client = Client()
        self._models: dict[ArmConfig, PandaModel] = {}

    def resting(self, scene: Scene, parameters: WorldParameters) -> list[BodyState]:
        """Return the states of bodies that stand at rest where a scene (N, 8) has them."""
        rows = zip(scene, parameters.mass_offsets, strict=True)
        return [resting(self.client, state, offset) for state, offset in rows]

    def build(self, parameters: WorldParameters, origin: Origin, steps: int) -> "BulletCell":
        """Build a workcell with these bodies, after so many earlier control steps."""
        model = self._described(parameters.roughness.arm(self.config.arm))
        return BulletCell(self.client, model, self.config, parameters, origin, steps)

    def _described(self, arm: ArmConfig) -> PandaModel:
        """Return the description of an arm; each is written once."""
        if arm not in self._models:
            radius = self.config.feasibility.limits.tool_radius
            self._models[arm] = PandaModel(radius, arm)
        return self._models[arm]

    def close(self) -> None:
        """Disconnect; a second call does nothing."""
        self.client.close()


class BulletCell(Workcell):
    """Built for one push; building takes about 2 ms.

    Bullet's contact solver and broad phase keep data from earlier steps. These can be neither read
    nor saved (`saveState` loses them, and last bits), so equal worlds would give different
    results. A new workcell has none.
    """

    arm: Arm

    def __init__(
        self,
        client: Client,
        model: PandaModel,
        config: WorldConfig,
        parameters: WorldParameters,
        origin: Origin,
        steps: int,
    ) -> None:
        """Empty the client and build everything in it.

        Args:
            client: the world's client, which is emptied.
            model: the arm's description.
            config: how the world is simulated.
            parameters: of the bodies.
            origin: the state to start from.
            steps: earlier control steps, from which time is counted.
        """
        super().__init__(config, origin, steps)
        self._client = client
        table = config.feasibility.table
        client.resetSimulation()
        client.setGravity(*parameters.roughness.gravity(GRAVITY))
        client.setTimeStep(config.motion.time_step)
        client.setPhysicsEngineParameter(
            deterministicOverlappingPairs=1, contactBreakingThreshold=CONTACT_BREAKING
        )
        body = model.load(client, -table.height)
        self.arm = Arm(client, body, config.kinematics, model, config.motion.time_step)
        self.arm.place(origin.joints)
        self.stage = Stage(client, parameters, table, origin.states)
        self.arm.set_friction(self.stage.tool_friction)

    def states(self) -> list[BodyState]:
        """Return the bodies' states."""
        return self.stage.states()

    def scene(self, states: list[BodyState]) -> Scene:
        """Return the scene (N, 8) of bodies in these states."""
        return self.stage.scene(states)

    def fallen(self) -> Mask:
        """Tell which bodies (N,) have left the table."""
        return self.stage.fallen()

    def still(self) -> bool:
        """Tell whether every body on the table is settled; fallen bodies do not count."""
        return self.stage.still()

    def advance(self) -> None:
        """Simulate one control step."""
        self.stage.before_step()
        if self.arm.spring is not None:
            self.arm.spring.pull()
        self._client.stepSimulation()

    def touched(self, pushed: int) -> int | None:
        """Return the first body but the pushed one that the tool touches, if any."""
        return self.stage.touched_by(self.arm.body, self.arm.stick, pushed)
