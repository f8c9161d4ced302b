"""Draws the laboratory for a camera by casting rays: no display, no graphics driver.

Rays are cast only where arm and bodies may be; the table is a plane. 640 x 360 px with a UR5
take 20 ms. Bullet's software renderer takes 100 ms, and MuJoCo's own needs a driver (EGL or
OSMesa) that no wheel has.
"""

from typing import Final

import mujoco
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_arm.laboratory.cell import Cell
from sain_arm.robot.arm_model import BODY
from sain_arm.robot.silhouette import Silhouettes
from sain_core.camera.image_camera import Drawing, ImageCameraConfig
from sain_core.scene import POSE, Table
from sain_core.types import Scene
from sain_core.view.palette import PALETTE, rgba
from sain_core.view.scenes import colours_of

FAR: Final = 10.0  # [m]
AMBIENT: Final = 0.6
TOP: Final = np.array([0.91, 0.89, 0.86])  # colours: of the table
FLOOR: Final = np.array([0.55, 0.53, 0.51])
SKY: Final = np.array([0.88, 0.91, 0.94])
ARM: Final = np.array([0.62, 0.66, 0.70])


class LaboratoryView:
    """An `ImageRenderer` of a cell. It has data of its own, so that it may have its own thread."""

    def __init__(self, cell: Cell, config: ImageCameraConfig, table: Table = Table()) -> None:
        """Look at a cell as a camera does."""
        self._cell, self._config, self._table = cell, config, table
        self._data = mujoco.MjData(cell.model)
        model = cell.model
        names = [model.body(int(body)).name for body in model.geom_bodyid]
        self._geoms = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] > 0]
        self._silhouettes = Silhouettes(model, self._geoms)
        paint = [rgba(PALETTE.named(name))[:3] for name in colours_of(cell.bodies.bodies)]
        bodies = [name.removeprefix(BODY) if name.startswith(BODY) else "" for name in names]
        self._is_body = np.array([bool(body) for body in bodies])
        self._colours = np.array([paint[int(body)] if body else ARM for body in bodies])
        self._light = np.array(config.light) / np.linalg.norm(config.light)
        self._size = 0, 0

    def drawing(self, joints: ndarray, scene: Scene, width: int, height: int) -> Drawing:
        """Return the arm with joints (J,), table and bodies (N, 8), in so many pixels."""
        self._resize(width, height)
        self._cell.set(self._data, joints, scene[:, POSE])
        mujoco.mj_kinematics(self._cell.model, self._data)
        colour, depth = self._empty[0].copy(), self._empty[1].copy()
        hides = np.zeros(depth.shape, dtype=bool)
        where = self._silhouettes.draw(self._data, self._project, width, height, 1)
        rays = np.ascontiguousarray(self._rays[where])
        count = len(rays)
        geoms, distances = np.full(count, -1, np.int32), np.zeros(count)
        normals = np.zeros(3 * count)
        mujoco.mj_multiRay(
            self._cell.model, self._data, np.array(self._config.eye), rays.ravel(), None, False, -1,
            geoms, distances, normals, count, FAR,
        )  # fmt: skip
        is_hit = geoms >= 0
        shade = AMBIENT + (1.0 - AMBIENT) * np.maximum(normals.reshape(-1, 3) @ self._light, 0.0)
        colour[where] = np.where(
            is_hit[:, None], self._colours[geoms] * shade[:, None], colour[where]
        )
        depth[where] = np.where(is_hit, distances, depth[where])
        hides[where] = is_hit & ~self._is_body[geoms]
        return Drawing((255.0 * colour).astype(np.uint8), depth, hides)

    def close(self) -> None:
        """Nothing is held."""

    def _resize(self, width: int, height: int) -> None:
        """Compute rays, and a picture of the table alone."""
        if self._size == (width, height):
            return
        self._size, config = (width, height), self._config
        self._scale = width / config.width, height / config.height
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1) + 0.5
        (focal, _, across), (_, _, down), _ = config.matrix
        flat = (grid / self._scale - 0.5 - (across, down)) / focal
        rays = np.concatenate([flat, np.ones((height, width, 1))], axis=-1) @ config.rotation.T
        self._rays = rays  # one metre along the optical axis, so their lengths are depths
        eye, table = np.array(config.eye), self._table
        depth = np.where(rays[..., 2] < 0.0, -eye[2] / np.minimum(rays[..., 2], -1e-9), FAR)
        x, y = np.moveaxis((eye + depth[..., None] * rays)[..., :2], -1, 0)
        on_top = (x > table.x_min) & (x < table.x_max) & (abs(y) < table.y_max)
        colour = np.where(on_top[..., None], TOP, FLOOR)
        colour[depth >= FAR] = SKY
        self._empty = colour, np.minimum(depth, FAR)

    def _project(self, places: Float[ndarray, "P 3"]) -> Float[ndarray, "P 2"]:
        config = self._config
        seen = (places - config.eye) @ config.rotation @ config.matrix.T
        ahead = np.where(seen[:, 2:] > 0.05, seen[:, 2:], np.nan)
        return np.asarray((seen[:, :2] / ahead + 0.5) * self._scale - 0.5)
