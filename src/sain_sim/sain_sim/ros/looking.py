"""When a camera looks: at its rate while a scene is new, then as seldom as idle scenes are sent."""

from typing import Final

from sain_sim.camera.camera import Camera
from sain_sim.ros.pacing import Pacer
from sain_sim.world.workcell import Sample

NEW: Final = 5.0  # [s], simulated, for which a scene at rest is new: 150 frames at 30 Hz
HASTE: Final = 5.0  # times as fast as the wall clock, where the world runs as fast as possible


class Looking:
    """A camera over bodies that rest or move. Simulated time goes on from frame to frame."""

    def __init__(self, camera: Camera, pacer: Pacer, factor: float, idle_rate: float) -> None:
        """Look through a camera; the world runs so many times as fast as the wall clock, or 0."""
        self._camera, self._pacer, self._factor = camera, pacer, factor
        self.timer_period = camera.period / (factor or HASTE)  # [s] of wall time
        self._seldom = max(1, round(1.0 / (idle_rate * self.timer_period)))
        self._looks = 0

    def renew(self) -> None:
        """Look at a new scene from now on."""
        self._looks = 0

    def look(self, sample: Sample) -> bool:
        """Take a frame of bodies at rest, if it is time for one; tell if it was."""
        self._looks += 1
        if self._looks * self._camera.period > NEW and self._looks % self._seldom:
            return False
        if self._factor > 0.0:
            self._pacer.idle()
        else:
            self._pacer.skip(self._camera.period)
        self._camera.take(sample.scene, self._pacer.now)
        return True

    def watch(self, sample: Sample) -> None:
        """Take a frame of bodies that move."""
        self._camera.take(sample.scene, self._pacer.now, moving=True)
