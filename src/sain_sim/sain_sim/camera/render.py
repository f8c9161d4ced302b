"""Pictures of a world from its recording: joints and disks in, an image out; and a window.

A renderer has a client of its own that is never stepped, so the world that is shown need not
exist any more. It draws with Bullet's software renderer and needs no display. Each picture is
drawn twice as large and averaged down, which smooths the edges.
"""

from typing import Final

import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from sain_core.camera.image_camera import Drawing, ImageCamera, ImageCameraConfig
from sain_core.push import TOOL_RADIUS
from sain_core.scene import DISK_HEIGHT, RADIUS, THETA, Table, X, Y
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.body_file import Tag
from sain_core.shapes.solids import DISK
from sain_core.types import Points, Scene
from sain_core.view.scenes import colours_of
from sain_sim.arm.client import Client, Closeable
from sain_sim.arm.motion import Joints
from sain_sim.arm.panda import JOINT_COUNT, PandaModel
from sain_sim.camera.scenery import (
    OFF_STAGE,
    build_disk,
    build_mark,
    build_ring,
    build_table,
)

Image = UInt8[ndarray, "height width 3"]
Depth = Float[ndarray, "height width"]  # [m]
Identities = Int[ndarray, "height width"]
NEAR: Final = 0.1  # [m]
FAR: Final = 10.0  # [m]

SKY: Final = np.array([[0.80, 0.86, 0.92], [0.97, 0.97, 0.96]])  # upper and lower edge
OVERSAMPLING: Final = 2  # so many times as large is a picture drawn

_UNMADE: Final = -1


class Renderer(Closeable):
    """Takes pictures of a Panda, a table and N disks."""

    def __init__(
        self,
        scene: Scene,
        shapes: tuple[str, ...] | None = None,
        camera: ImageCameraConfig = ImageCameraConfig(),
        table: Table = Table(),
        gui: bool = False,
        marked: bool = True,
    ) -> None:
        """Build everything that will be seen, with as many and as large disks as a scene (N, 8).

        All shapes are disks if None. With `gui` a window opens; `show` moves what is in it. Where
        they are `marked`, bodies show how they are turned.
        """
        self.camera = camera
        self._client = Client(gui)
        self._client.configureDebugVisualizer(self._client.COV_ENABLE_GUI, 0)
        build_table(self._client, table)
        model = PandaModel(TOOL_RADIUS, visuals=True)
        self._arm = model.load(self._client, -table.height)
        shapes = shapes or (DISK,) * len(scene)
        colours = colours_of(Bodies.named(shapes))
        self._disks = [
            build_disk(self._client, colour, shape, float(state[RADIUS]), marked)
            for colour, shape, state in zip(colours, shapes, scene, strict=True)
        ]
        self._goals: dict[float, int] = {}
        self._projection = self._client.computeProjectionMatrixFOV(
            camera.field_of_view, camera.width / camera.height, NEAR, FAR
        )
        self._mark = _UNMADE
        self._view = self._client.computeViewMatrix(camera.eye, camera.focus, [0.0, 0.0, 1.0])

    def mark_goal(self, corners: Points) -> None:
        """Show an outline (C, 2) [m] as the goal from now on, instead of a ring."""
        self._mark = build_mark(self._client, corners)

    def _move_arm(self, joints: Joints) -> None:
        for joint, value in enumerate(joints.tolist()[:JOINT_COUNT]):
            self._client.resetJointState(self._arm, joint, value)

    def show(
        self, joints: Joints, scene: Scene, goal: Points | None = None, goal_radius: float = 0.05
    ) -> None:
        """Move everything to joints (7,), disks (N, 8), and a goal ring about (2,) if given."""
        client = self._client
        self._move_arm(joints)
        for body, state in zip(self._disks, scene, strict=True):
            turn = client.getQuaternionFromEuler([0.0, 0.0, float(state[THETA])])
            place = [float(state[X]), float(state[Y]), DISK_HEIGHT / 2]
            client.resetBasePositionAndOrientation(body, place, turn)
        for body in self._goals.values():
            client.resetBasePositionAndOrientation(body, OFF_STAGE, [0, 0, 0, 1])
        if goal is not None and self._mark == _UNMADE:
            if goal_radius not in self._goals:
                self._goals[goal_radius] = build_ring(client, goal_radius)
            place = [float(goal[0]), float(goal[1]), 0.0]
            client.resetBasePositionAndOrientation(self._goals[goal_radius], place, [0, 0, 0, 1])

    def picture(
        self, joints: Joints, scene: Scene, goal: Points | None = None, goal_radius: float = 0.05
    ) -> Image:
        """Return an image (height, width, 3) of what `show` moves."""
        self.show(joints, scene, goal, goal_radius)
        camera, times = self.camera, OVERSAMPLING
        colours, _, _ = self.draw(camera.width * times, camera.height * times)
        return np.asarray(_average(colours, times).round(), dtype=np.uint8)

    def draw(self, width: int, height: int) -> tuple[Image, Depth, Identities]:
        """Return colours, distances along the optical axis [m] and bodies, as `show` left all.

        Where there is nothing, the distance is `FAR` and the body is -1.
        """
        _, _, pixels, depth, bodies = self._client.getCameraImage(
            width,
            height,
            viewMatrix=self._view,
            projectionMatrix=self._projection,
            lightDirection=self.camera.light,
            lightColor=[1.0, 0.99, 0.97],
            lightAmbientCoeff=0.60,
            lightDiffuseCoeff=0.42,
            lightSpecularCoeff=0.10,
            shadow=0,
            renderer=self._client.ER_TINY_RENDERER,
        )
        colours = np.reshape(np.asarray(pixels, dtype=np.uint8), (height, width, 4))[..., :3]
        body = np.reshape(np.asarray(bodies), (height, width))
        buffer = np.reshape(np.asarray(depth, dtype=np.float64), (height, width))
        distance = FAR * NEAR / (FAR - (FAR - NEAR) * buffer)
        return np.where(body[..., None] >= 0, colours, _sky(height)), distance, body

    def drawing(self, joints: Joints, scene: Scene, width: int, height: int) -> Drawing:
        """Return what an `ImageCamera` sees of an arm with joints (7,) and of bodies (N, 8)."""
        self.show(joints, scene)
        colours, distances, bodies = self.draw(width, height)
        return Drawing(colours, distances, np.asarray(bodies == self._arm))

    def close(self) -> None:
        """Close the renderer's client."""
        self._client.close()


def image_camera(
    config: ImageCameraConfig,
    scene: Scene,
    shapes: tuple[str, ...],
    table: Table = Table(),
) -> ImageCamera:
    """Return a camera over a Panda and bodies of these shapes, as large as in a scene (N, 8).

    Each body has the tag with its own number in the middle.

    Raises:
        ConfigError: PyBullet, which draws, is not installed.
    """
    size = config.tag_size
    tags = [(Tag(body, size),) if size > 0.0 else () for body in range(len(scene))]
    renderer = Renderer(scene, shapes, config, table, marked=False)
    return ImageCamera(config, renderer, tags)


def _sky(height: int) -> ndarray:
    """Return a soft background, a column (height, 1, 3) of uint8."""
    down = np.linspace(0.0, 1.0, height)[:, None, None]
    return np.asarray(255 * ((1 - down) * SKY[0] + down * SKY[1]), dtype=np.uint8)


def _average(image: ndarray, times: int) -> ndarray:
    """Return the image (height, width, channels) as numbers, so many times smaller."""
    corners = [(row, column) for row in range(times) for column in range(times)]
    total = sum(image[row::times, column::times].astype(np.float32) for row, column in corners)
    return np.asarray(total / times**2)
