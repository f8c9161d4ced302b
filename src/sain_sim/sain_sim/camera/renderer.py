"""Draws a robot, a table and bodies by casting rays: no display, no graphics driver.

Rays are cast only where arm and bodies may be; what never moves is drawn once. MuJoCo's own
renderer needs a driver (EGL or OSMesa) that no wheel has.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import cv2
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from numpy import ndarray

from sain_arm.robot.arm_model import BODY, compiled, robot_spec, solid_geoms
from sain_arm.robot.robot import Robot, Vector
from sain_arm.robot.silhouette import Places, Silhouettes
from sain_arm.robot.urdf import ROD
from sain_core.camera.image_camera import Drawing, ImageCamera, ImageCameraConfig
from sain_core.scene import POSITION, THETA, Table
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.body_file import Tag
from sain_core.shapes.shape import Shape
from sain_core.types import Points, Scene
from sain_core.view.palette import PALETTE, rgba
from sain_core.view.scenes import colours_of

Image = UInt8[ndarray, "height width 3"]
Colours = Float[ndarray, "height width 3"]  # shares of red, green and blue

FAR: Final = 10.0  # [m], as far as rays go
AMBIENT, DIRECT = 0.66, 0.40  # light from everywhere and from the lamp; 1 shows a colour as it is
OVERSAMPLING: Final = 2  # so many times as large a picture is drawn
INK: Final = 0.5  # share of the light that edges in a picture keep
ACNE: Final = 0.004  # share of a way to the light, within which nothing casts a shadow
HULL: Final = 300  # corners of a link at most
MOVING, SCENERY, MARKS = range(3)  # groups of geometries
SKY: Final = rgba("#e6edf2")
FLOOR: Final = rgba("#d3dae0")
TOP: Final = rgba("#f1eae0")
BLOCK: Final = rgba("#d0c6b5")
PEDESTAL: Final = rgba("#9aa2a9")
LINKS: Final = (rgba("#f6f7f8"), rgba("#a9b8c6"))  # in turn, from the base on
TOOL: Final = rgba("#2b3036")
MARK: Final = rgba("#ffffff")
TOP_THICKNESS: Final = 0.02  # [m]
INSET: Final = 0.97  # share of the top that the block under it has
STAND: Final = 0.08  # [m], half of the width of a pedestal
MARK_WIDTH: Final = 0.01  # [m]
MARK_HEIGHT: Final = 0.0012  # [m]
BAND: Final = 0.008  # [m], width of the outline of a goal


class _Layer(NamedTuple):
    """What rays hit: an image, or a list of pixels."""

    colour: Float[ndarray, "... 3"]
    glow: Float[ndarray, "..."]  # cosine of the angle of the light
    depth: Float[ndarray, "..."]  # along the optical axis [m]
    body: Int[ndarray, "..."]  # of the model; -1: nothing


class Renderer:
    """An `ImageRenderer`. It has a model of its own, so that it may have its own thread."""

    def __init__(
        self,
        robot: Robot,
        bodies: Bodies,
        radii: Sequence[float],
        camera: ImageCameraConfig = ImageCameraConfig(),
        table: Table = Table(),
    ) -> None:
        """Build a robot, a table and bodies with these radii [m].

        Raises:
            ConfigError: MuJoCo refuses the robot.
        """
        self.camera, bodies = camera, bodies.fitted(len(radii))
        spec = robot_spec(robot)
        for mesh in spec.meshes:
            mesh.maxhullvert = HULL  # rays take twice as long for the fine meshes of SO-101
        _paint_links(spec)
        _add_scenery(spec, robot, table)
        for index, (shape, radius) in enumerate(zip(bodies.shapes, radii, strict=True)):
            body = spec.worldbody.add_body(name=f"{BODY}{index}", mocap=True)
            colour = rgba(PALETTE.named(colours_of(bodies)[index]))
            for geom in solid_geoms(spec, body, shape, radius, bodies.tops[index]):
                geom.rgba = colour
            _mark_heading(body, shape, radius, bodies.tops[index])
        self.model = compiled(robot, spec)
        self.data = mujoco.MjData(self.model)
        self._joints = [self.model.joint(name).qposadr[0] for name in robot.joints]
        self._hides = np.array([not self.model.body(n).name.startswith(BODY)
                                for n in range(self.model.nbody)])  # fmt: skip
        self._hides[0] = False  # the scenery, and the last one is nothing
        moving = np.flatnonzero(self.model.geom_group == MOVING)
        self._middles = np.array(bodies.tops) / 2
        self._silhouettes = Silhouettes(self.model, moving.tolist())
        self._light = np.array(camera.light) / np.linalg.norm(camera.light)
        self._size = 0, 0

    def place(self, joints: Vector, scene: Scene) -> None:
        """Move the arm to joints (J,) and the bodies to a scene (N, 8)."""
        self.data.qpos[self._joints] = joints
        half = scene[:, THETA] / 2.0
        self.data.mocap_pos[:, :2], self.data.mocap_pos[:, 2] = scene[:, POSITION], self._middles
        self.data.mocap_quat[:] = 0.0
        self.data.mocap_quat[:, 0], self.data.mocap_quat[:, 3] = np.cos(half), np.sin(half)
        mujoco.mj_kinematics(self.model, self.data)

    def drawing(self, joints: Vector, scene: Scene, width: int, height: int) -> Drawing:
        """Return the arm with joints (J,), table and bodies (N, 8), in so many pixels."""
        self.place(joints, scene)
        layer = self._draw(width, height, (MOVING,))
        colour = _shaded(layer.colour, AMBIENT + DIRECT * layer.glow)
        return Drawing(colour, layer.depth, self._hides[layer.body])

    def picture(self, joints: Vector, scene: Scene, goals: Sequence[Points] = ()) -> Image:
        """Return the same for people: smooth, with shadows, edges and how bodies are turned.

        Goals are outlines (C, 2) [m] on the table.
        """
        self.place(joints, scene)
        wide, high = self.camera.width, self.camera.height
        size = wide * OVERSAMPLING, high * OVERSAMPLING
        layer = self._draw(*size, (MOVING, MARKS), goals)
        lit = cv2.resize(self._lit(layer.depth), size, interpolation=cv2.INTER_LINEAR)
        light = AMBIENT + DIRECT * layer.glow * lit
        drawn = _shaded(layer.colour, np.where(_edges(layer.body), INK * light, light))
        return np.asarray(cv2.resize(drawn, (wide, high), interpolation=cv2.INTER_AREA))

    def _draw(
        self, width: int, height: int, groups: Sequence[int], goals: Sequence[Points] = ()
    ) -> _Layer:
        """Return the image as the robot and the bodies were placed."""
        self._resize(width, height)
        layer = _Layer(*(part.copy() for part in self._scenery))
        for goal in goals:
            self._draw_goal(layer.colour, goal)
        where = self._silhouettes.draw(self.data, self._project, width, height, 2)
        hits = self._cast(self._rays[where], groups)
        hit = (hits.body >= 0) & (hits.depth < layer.depth[where])
        for image, pixels in zip(layer, hits, strict=True):
            image[where] = np.where(hit[:, None] if pixels.ndim > 1 else hit, pixels, image[where])
        return layer

    def _cast(self, rays: ndarray, groups: Sequence[int], eye: ndarray | None = None) -> _Layer:
        """Return what rays (P, 3) hit from the eye; depths are in lengths of the rays."""
        count, chosen = len(rays), np.isin(np.arange(mujoco.mjNGROUP), groups).astype(np.uint8)
        geoms, depth = np.full(count, -1, np.int32), np.zeros(count)
        normals, eye = np.zeros(3 * count), np.array(self.camera.eye) if eye is None else eye
        mujoco.mj_multiRay(
            self.model, self.data, eye, np.ascontiguousarray(rays).ravel(), chosen, True, -1,
            geoms, depth, normals, count, FAR,
        )  # fmt: skip
        glow = np.maximum(normals.reshape(-1, 3) @ self._light, 0.0)
        body = np.where(geoms >= 0, self.model.geom_bodyid[geoms], -1)
        return _Layer(self.model.geom_rgba[geoms, :3], glow, depth, body)

    def _lit(self, depth: ndarray) -> Float[ndarray, "height width"]:
        """Return the share of the light that reaches each pixel of the camera."""
        half = OVERSAMPLING // 2
        part = np.s_[half::OVERSAMPLING, half::OVERSAMPLING]
        light = np.array(self.camera.light)
        places = self.camera.eye + depth[part][..., None] * self._rays[part]
        hit = self._cast((places - light).reshape(-1, 3), (MOVING, SCENERY), light)
        dark = (hit.body >= 0) & (hit.depth < 1.0 - ACNE)
        lit = np.where(dark.reshape(places.shape[:2]), np.float32(0.0), np.float32(1.0))
        return np.asarray(cv2.GaussianBlur(lit, (0, 0), 1.0))

    def _resize(self, width: int, height: int) -> None:
        """Compute rays, and a picture of what never moves."""
        if self._size == (width, height):
            return
        self._size, config = (width, height), self.camera
        self._scale = width / config.width, height / config.height
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1) + 0.5
        (focal, _, across), (_, _, down), _ = config.matrix
        flat = (grid / self._scale - 0.5 - (across, down)) / focal
        rays = np.concatenate([flat, np.ones((height, width, 1))], axis=-1) @ config.rotation.T
        self._rays = rays  # one metre along the optical axis, so their lengths are depths
        layer = self._cast(rays.reshape(-1, 3), (SCENERY,))
        sky = layer.body < 0
        layer.colour[sky], layer.glow[sky], layer.depth[sky] = SKY[:3], 1.0, FAR
        self._scenery = [part.reshape(height, width, *part.shape[1:]) for part in layer]

    def _project(self, places: Places) -> Float[ndarray, "P 2"]:
        config = self.camera
        seen = (places - config.eye) @ config.rotation @ config.matrix.T
        ahead = np.where(seen[:, 2:] > 0.05, seen[:, 2:], np.nan)
        return np.asarray((seen[:, :2] / ahead + 0.5) * self._scale - 0.5)

    def _draw_goal(self, colour: Colours, goal: Points) -> None:
        """Draw a closed outline (C, 2) [m] on the table."""
        from shapely import LinearRing

        band = LinearRing(goal).buffer(BAND / 2, join_style="mitre")
        rings = [np.array(ring.coords) for ring in (band.exterior, *band.interiors)]
        pixels = [self._project(np.column_stack([ring, np.zeros(len(ring))])) for ring in rings]
        if all(np.isfinite(ring).all() for ring in pixels):
            cv2.fillPoly(colour, [ring.round().astype(np.int32) for ring in pixels],
                         rgba(PALETTE.goal)[:3])  # fmt: skip


def _shaded(colour: Colours, light: Float[ndarray, "height width"]) -> Image:
    return np.minimum(255.0 * colour * light[..., None], 255.0).astype(np.uint8)


def _edges(body: Int[ndarray, "height width"]) -> Bool[ndarray, "height width"]:
    """Return the pixels where another body begins."""
    edges = np.zeros(body.shape, dtype=bool)
    edges[:, 1:] |= body[:, 1:] != body[:, :-1]
    edges[1:] |= body[1:] != body[:-1]
    return edges


def _paint_links(spec: Any) -> None:
    """Paint each link as the last one is not, so that they can be told apart."""
    links = [body for body in spec.bodies if body.geoms and body.name != "world"]
    for number, body in enumerate(links):
        for geom in body.geoms:
            geom.rgba = TOOL if body.name == ROD else LINKS[number % 2]
            geom.group = MOVING


def _mark_heading(body: Any, shape: Shape, radius: float, height: float) -> None:
    """Add a line that shows how a body is turned, if there is room for it ahead of its middle."""
    from shapely import Polygon, box

    near, far = 0.41 * radius, 0.91 * radius
    if Polygon(shape.outline(radius)).contains(box(near, -MARK_WIDTH / 2, far, MARK_WIDTH / 2)):
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[(far - near) / 2, MARK_WIDTH / 2, MARK_HEIGHT / 2],
            pos=[(near + far) / 2, 0.0, (height + MARK_HEIGHT) / 2],
            rgba=MARK,
            group=MARKS,
        )


def _add_scenery(spec: Any, robot: Robot, table: Table) -> None:
    """Add a light table top on a block, the floor, and what the robot's base stands on."""
    under = max(table.height, 2 * TOP_THICKNESS)
    middle = [(table.x_min + table.x_max) / 2, (table.y_min + table.y_max) / 2]
    size = [(table.x_max - table.x_min) / 2, (table.y_max - table.y_min) / 2]
    block = [INSET * size[0], INSET * size[1], (under - TOP_THICKNESS) / 2]
    box, world = mujoco.mjtGeom.mjGEOM_BOX, spec.worldbody
    lowest = -TOP_THICKNESS / 2
    world.add_geom(type=box, size=[*size, -lowest], pos=[*middle, lowest], rgba=TOP, group=SCENERY)
    centre = [*middle, -TOP_THICKNESS - block[2]]
    world.add_geom(type=box, size=block, pos=centre, rgba=BLOCK, group=SCENERY)
    plane = mujoco.mjtGeom.mjGEOM_PLANE
    world.add_geom(type=plane, size=[0, 0, 1], pos=[0, 0, -under], rgba=FLOOR, group=SCENERY)
    height, base = under, spec.worldbody.first_body()
    while base is not None and not base.joints:
        height += float(base.pos[2])
        if base.geoms and height > 0.001:
            size, centre = [STAND, STAND, height / 2], [*robot.base, height / 2 - under]
            world.add_geom(type=box, size=size, pos=centre, rgba=PEDESTAL, group=SCENERY)
        base = None if base.geoms else base.first_body()


def image_camera(
    config: ImageCameraConfig,
    robot: Robot,
    bodies: Bodies,
    radii: Sequence[float],
    table: Table = Table(),
    tags: Sequence[Sequence[Tag]] | None = None,
) -> ImageCamera:
    """Return a camera over a robot and bodies with these radii [m].

    Without `tags` each body has the tag with its own number in the middle.
    """
    if tags is None:
        size = config.tag_size
        tags = [(Tag(body, size),) if size > 0.0 else () for body in range(len(bodies))]
    tops = bodies.fitted(len(radii)).tops
    return ImageCamera(config, Renderer(robot, bodies, radii, config, table), tags, tops)
