"""The arm in MuJoCo: where its links are, and what touches what.

The model has the arm's joints alone. Bodies are mocap bodies that are placed before a question.
"""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial.transform import Rotation

from sain_arm.robot.mesh import mesh_hull
from sain_arm.robot.robot import Joints, Robot, Vector
from sain_arm.robot.urdf import ROD, TIP
from sain_core.errors import ConfigError
from sain_core.guarding.untrusted import one_line
from sain_core.scene import DISK_HEIGHT, POSITION, THETA
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.shape import Shape, Solid, prism_surface
from sain_core.types import Scene

TABLE: Final = "sain_table"
BODY: Final = "sain_body"
SELF_GAP: Final = 0.0  # [m], between links
GAP: Final = 0.003  # [m], between a link and table or bodies
DRAWS: Final = 200  # postures, of which links that always touch are known
OFTEN: Final = 0.9  # of them


Pose = tuple[Float[ndarray, "3"], Rotation]  # place [m] and turn in another frame


@dataclass(frozen=True)
class ChainJoint:
    """A joint of the arm at 0, with the link that it moves."""

    name: str
    slides: bool
    pose: Pose  # of the link in the link of the joint before, or in the world
    axis: Float[ndarray, "3"]  # in the link's frame


@dataclass(frozen=True)
class Contact:
    """Two things that touch, by their names; `body` is the index of a body, or None.

    Attributes:
        first: a link.
        second: another link, the table or a body.
        body: which body it is.
        is_tool: whether the link is the rod.
        gap: between them [m]; below 0 they overlap.
    """

    first: str
    second: str
    body: int | None
    is_tool: bool
    gap: float


class ArmModel:
    """Kinematics and contacts of a robot over a table with bodies."""

    def __init__(
        self,
        robot: Robot,
        bodies: Bodies | None = None,
        radii: tuple[float, ...] = (),
    ) -> None:
        """Build the model; without bodies there is the table alone.

        Raises:
            ConfigError: MuJoCo refuses the robot, or links touch at home that must not.
        """
        self.robot = robot
        spec = robot_spec(robot)
        spec.worldbody.add_geom(
            name=TABLE, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[3.0, 3.0, 0.1], margin=GAP
        )
        shapes = () if bodies is None else bodies.shapes
        self._heights = () if bodies is None else bodies.tops
        for index, of in enumerate(zip(shapes, radii, self._heights, strict=True)):
            body = spec.worldbody.add_body(name=f"{BODY}{index}", mocap=True)
            for geom in solid_geoms(spec, body, *of):
                geom.margin = GAP
        self.model = compiled(robot, spec)
        self.data = mujoco.MjData(self.model)
        names = [self.model.joint(index).name for index in range(self.model.njnt)]
        self.order = np.array([names.index(name) for name in robot.joints])
        assert self.model.nq == len(robot.joints)
        self._tip = self.model.body(TIP).id
        self._names = [self.model.body(index).name for index in range(self.model.nbody)]
        self._count = len(shapes)
        self._harmless = self._always_touching()

    def place(self, scene: Scene) -> None:
        """Put the bodies where a scene (N, 8) has them."""
        for index, state in enumerate(scene[: self._count]):
            x, y = state[POSITION]
            half = state[THETA] / 2.0
            mocap = self.model.body(f"{BODY}{index}").mocapid[0]
            self.data.mocap_pos[mocap] = [x, y, self._heights[index] / 2]
            self.data.mocap_quat[mocap] = [np.cos(half), 0.0, 0.0, np.sin(half)]

    def set_joints(self, joints: Vector) -> None:
        """Move the arm to joints (J,)."""
        self.data.qpos[self.order] = joints
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def tip(self, joints: Vector) -> Float[ndarray, "3"]:
        """Return where the tool's tip is [m]."""
        self.set_joints(joints)
        return np.array(self.data.xpos[self._tip])

    def tips(self, joints: Joints) -> Float[ndarray, "T 3"]:
        """Return where the tool's tip is, (T, 3) [m], for joints (T, J)."""
        return np.array([self.tip(row) for row in joints])

    def chain(self) -> list[ChainJoint]:
        """Return the arm's joints from the base on, in the robot's order."""
        self.set_joints(np.zeros(len(self.order)))
        chain, above = [], 0
        for name in self.robot.joints:
            joint = self.model.joint(name)
            body = int(self.model.jnt_bodyid[joint.id])
            slides = self.model.jnt_type[joint.id] == mujoco.mjtJoint.mjJNT_SLIDE
            chain.append(ChainJoint(name, bool(slides), self._pose(body, above), joint.axis))
            above = body
        return chain

    def tip_pose(self) -> Pose:
        """Return the pose of the tool's tip in the link of the last joint."""
        self.set_joints(np.zeros(len(self.order)))
        last = int(self.model.jnt_bodyid[self.model.joint(self.robot.joints[-1]).id])
        return self._pose(self._tip, last)

    def _pose(self, body: int, within: int) -> Pose:
        """Return the pose of a body in the frame of another one, of the joints set last."""
        places, turns = self.data.xpos, self.data.xmat.reshape(-1, 3, 3)
        turn = turns[within].T @ turns[body]
        return turns[within].T @ (places[body] - places[within]), Rotation.from_matrix(turn)

    def frames(self, joints: Vector) -> dict[str, tuple[ndarray, ndarray]]:
        """Return place (3,) [m] and turn (w, x, y, z) of each link in the world, by its name."""
        self.set_joints(joints)
        links = [(n, name) for n, name in enumerate(self._names) if n and BODY not in name]
        return {name: (self.data.xpos[n].copy(), self.data.xquat[n].copy()) for n, name in links}

    def skeleton(self, joints: Vector) -> list[ndarray]:
        """Return the places (3,) [m] of the links from the base to the tip."""
        self.set_joints(joints)
        chain, body = [], self._tip
        while body:
            chain.append(np.array(self.data.xpos[body]))
            body = int(self.model.body_parentid[body])
        return chain[::-1]

    def axis(self) -> Float[ndarray, "3"]:
        """Return the direction of the tool, of the joints set last."""
        return np.array(self.data.xmat[self._tip].reshape(3, 3)[:, 2])

    def jacobian(self) -> Float[ndarray, "6 J"]:
        """Return how the tip moves and turns with the joints, of the joints set last."""
        linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jacBody(self.model, self.data, linear, angular, self._tip)
        return np.concatenate([linear, angular])[:, self.order]

    def contacts(self, joints: Vector) -> list[Contact]:
        """Return what touches where the arm has joints (J,): links, table and bodies."""
        self.set_joints(joints)
        mujoco.mj_collision(self.model, self.data)
        found = []
        for index in range(self.data.ncon):
            contact = self.data.contact[index]
            first, second = sorted(int(self.model.geom_bodyid[geom]) for geom in contact.geom)
            pair = first, second
            if pair in self._harmless:
                continue
            names = [self._names[body] for body in pair]
            things = [TABLE if name == "world" else name for name in names]
            links = [name for name in things if name != TABLE and not name.startswith(BODY)]
            if not links or (len(links) == 2 and contact.dist > SELF_GAP):
                continue
            others = [name for name in things if name not in links] or links[1:]
            body = int(others[0].removeprefix(BODY)) if others[0].startswith(BODY) else None
            is_tool = links[0] == ROD
            found.append(Contact(links[0], others[0], body, is_tool, float(contact.dist)))
        return found

    def _always_touching(self) -> set[tuple[int, int]]:
        """Return the pairs of links that one joint joins, or that touch in nearly every posture.

        Meshes are convex hulls here: neighbours overlap.

        Raises:
            ConfigError: other links touch at home.
        """
        random, robot = np.random.default_rng(0), self.robot
        counts = Counter[tuple[int, int]]()
        for joints in random.uniform(robot.lower, robot.upper, (DRAWS, len(robot.joints))):
            counts.update(self._link_pairs(joints).keys())
        often = {pair for pair, count in counts.items() if count > OFTEN * DRAWS}
        at_home = self._link_pairs(robot.home)
        joined = {pair for pair in {*counts, *at_home} if self._are_joined(*pair)}
        for pair, gap in at_home.items():
            if pair not in often | joined:
                first, second = (self._names[body] for body in pair)
                raise ConfigError(
                    f"robot {robot.name!r}: the links {first!r} and {second!r} touch at home,"
                    f" {-1e3 * gap:.1f} mm deep; allowed: links that one joint joins, or that touch"
                    f" in more than {OFTEN:.0%} of postures. Change home, or mend their collision"
                    " geometry, of which a mesh is taken as its convex hull"
                )
        return often | joined

    def _are_joined(self, first: int, second: int) -> bool:
        """Return True if at most one joint is between two links."""
        first, second = (int(self.model.body_weldid[body]) for body in (first, second))
        above = self.model.body_weldid[self.model.body_parentid]
        return first == second or above[first] == second or above[second] == first

    def _link_pairs(self, joints: Vector) -> dict[tuple[int, int], float]:
        """Return the pairs of links that touch, and the least gap [m] of each."""
        self.set_joints(joints)
        mujoco.mj_collision(self.model, self.data)
        pairs: dict[tuple[int, int], float] = {}
        for contact in map(self.data.contact.__getitem__, range(self.data.ncon)):
            first, second = sorted(int(self.model.geom_bodyid[geom]) for geom in contact.geom)
            are_links = first and not self._names[second].startswith(BODY)
            if are_links and contact.dist <= SELF_GAP:
                pair = first, second
                pairs[pair] = min(float(contact.dist), pairs.get(pair, 0.0))
        return pairs


def robot_spec(robot: Robot) -> Any:
    """Return the specification of a robot; its meshes are the corners that `mesh_corners` reads.

    Raises:
        ConfigError: MuJoCo takes it for no robot.
    """
    try:
        spec = mujoco.MjSpec.from_string(robot.description)
        for mesh in spec.meshes:
            mesh.uservert, mesh.file = mesh_hull(Path(mesh.file)).ravel(), ""
    except (ValueError, OSError) as error:
        raise _refusal(robot, error) from error
    return spec


def compiled(robot: Robot, spec: Any) -> Any:
    """Return the model of a specification with a robot; raises as `robot_spec`."""
    try:
        return spec.compile()
    except ValueError as error:
        raise _refusal(robot, error) from error


def _refusal(robot: Robot, error: Exception) -> ConfigError:
    return ConfigError(f"robot {robot.name!r} is refused by MuJoCo: {one_line(error)}")


def solid_geoms(
    spec: Any, body: Any, shape: Shape, radius: float, height: float = DISK_HEIGHT
) -> list[Any]:
    """Add a cylinder, a box, or the convex hulls of a prism to a body, centred on it."""
    if shape.solid is Solid.CYLINDER:
        size = [radius, height / 2, 0.0]
        return [body.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=size)]
    if shape.solid is Solid.BOX:
        size = [radius, radius, height / 2]
        return [body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=size)]
    geoms = []
    for number, corners in enumerate(shape.parts(radius)):
        points = np.unique(prism_surface(corners, height).reshape(-1, 3), axis=0)
        hull = spec.add_mesh(name=f"{body.name}_{number}", uservert=points.ravel())
        geoms.append(body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=hull.name))
    return geoms
