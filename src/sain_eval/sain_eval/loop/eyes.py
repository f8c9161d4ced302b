"""What an agent sees of a world, frame by frame, and pushes that start from what it saw."""

from collections.abc import Iterator
from typing import Final

from sain_core.types import PushArray, Scene
from sain_mppi.agent.play import Sight
from sain_sim.camera.camera import Camera, WorldCameraConfig
from sain_sim.world.checked import CheckedWorld
from sain_sim.world.outcome import Sample

MOST_FRAMES: Final = 2000  # of one scene; an agent that needs more never decides


class Eyes(Sight):
    """A camera above a world. Time goes on while it looks at bodies at rest."""

    world: CheckedWorld

    def __init__(self, world: CheckedWorld, config: WorldCameraConfig, seed: int) -> None:
        """Begin an episode with this seed."""
        super().__init__(world)
        self._camera = None if config.is_exact else Camera(config)
        self._looked = 0.0  # [s], while the world stood still
        if self._camera is not None:
            self._camera.begin(seed, world.parameters)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.world.time + self._looked

    def look(self) -> Iterator[tuple[Scene, float]]:
        """Yield frames of a scene (N, 8) at rest as they arrive; exact observations are one."""
        camera, scene = self._camera, self.world.observe()
        if camera is None:
            yield scene, self.time
            return
        for _ in range(MOST_FRAMES):
            self._looked += camera.period
            camera.take(scene, self.time)
            for frame in camera.arrived(self.time):
                yield frame.scene, frame.time

    def push(self, push: PushArray, seen: Scene) -> Scene:
        """Execute a push (5,) that was planned from a scene (N, 8), as seen; see `World.push`."""
        camera = self._camera
        if camera is None:
            return self.world.push(push).after
        watched = camera.config.delay > 0.0  # else frames of moving bodies are never of use
        every = self.world.config.steps_of(camera.period)
        outcome = self.world.push(push, self._watch if watched else None, every, seen)
        camera.count_push()
        return outcome.after

    def _watch(self, sample: Sample) -> None:
        if self._camera is not None:
            self._camera.take(sample.scene, sample.time + self._looked, moving=True)
