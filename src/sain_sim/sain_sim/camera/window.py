"""A window in which a person sees what a camera sees, and may look from elsewhere."""

import os
import sys
import threading

import numpy as np

from sain_arm.robot.robot import Vector
from sain_core.errors import ConfigError
from sain_core.types import Scene
from sain_sim.camera.renderer import AMBIENT, DIRECT, Renderer


class Window:
    """Shows the model of a renderer with MuJoCo's viewer."""

    def __init__(self, renderer: Renderer) -> None:
        """Open it.

        Raises:
            ConfigError: there is no display.
        """
        if sys.platform == "linux" and not os.environ.get("DISPLAY"):
            raise ConfigError("gui is true but DISPLAY is not set: there is no screen to show it")
        from mujoco import viewer  # needs a display

        self._renderer, camera, before = renderer, renderer.camera, set(threading.enumerate())
        lamp = renderer.model.vis.headlight
        lamp.ambient[:], lamp.diffuse[:] = AMBIENT, DIRECT
        self._viewer = viewer.launch_passive(
            renderer.model, renderer.data, show_left_ui=False, show_right_ui=False
        )
        self._threads = set(threading.enumerate()) - before
        x, y, z = way = np.subtract(camera.focus, camera.eye)
        with self._viewer.lock():
            self._viewer.cam.lookat[:] = camera.focus
            self._viewer.cam.distance = np.linalg.norm(way)
            self._viewer.cam.azimuth = np.degrees(np.arctan2(y, x))
            self._viewer.cam.elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))

    def show(self, joints: Vector, scene: Scene) -> None:
        """Move the arm to joints (J,) and the bodies to a scene (N, 8)."""
        with self._viewer.lock():
            self._renderer.place(joints, scene)
        self._viewer.sync()

    def close(self) -> None:
        """Close it, and await the viewer's threads: Python ends with a fault while they draw."""
        self._viewer.close()
        for thread in self._threads:
            thread.join()
