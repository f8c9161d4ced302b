"""A window that shows a world."""

from typing import Final

from sain_core.types import Scene
from sain_sim.arm.kinematics import Joints
from sain_sim.camera.render import Renderer
from sain_sim.world.world import World

EVERY: Final = 4  # control steps: 60 pictures a simulated second


class Window:
    """Shows a `World` on the screen."""

    every = EVERY

    def __init__(self) -> None:
        """Start closed: the world calls `open` when it is loaded."""
        self._renderer: Renderer | None = None

    def open(self, world: World) -> None:
        """Show a newly loaded world in place of the previous one.

        Raises:
            ConfigError: there is no display.
        """
        self.close()
        sample, config = world.sample(), world.config
        self._renderer = Renderer(
            sample.scene,
            world.parameters.shapes,
            table=config.feasibility.table,
            arm=config.arm,
            gui=True,
        )
        self.show(sample.joint_positions, sample.scene)

    def show(self, joints: Joints, scene: Scene) -> None:
        """Show the arm at joints (7,) [rad] and the disks as in a scene (N, 8)."""
        assert self._renderer is not None, "open comes first"
        self._renderer.show(joints, scene)

    def close(self) -> None:
        """Close the window; a second call does nothing."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
