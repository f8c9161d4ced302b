"""What MuJoCo simulates: an arm, a table and bodies. Every number has its source beside it.

Sources: [MuJoCo] its documentation, chapters Computation and XML reference; [Menagerie] the Panda
of github.com/google-deepmind/mujoco_menagerie (``panda_nohand.xml``). Masses, sizes and friction
are drawn. Of the arm only the tool collides, with a ball at half the height of bodies.

Contacts are between forms whose normals are exact, at heights that rounding does not change:

* A disk touches tool and disks with a ball of its radius about its middle. Disks that press against
  each other cannot climb, as two of MuJoCo's cylinders do.
* A prism is a convex hull for each part, a cube a box, both upright and of full height.
* A body has its height, with the centre of mass at half of it: pushed too high, it tips. The tool
  and disks touch at half the height of our own bodies, whatever stands there.
* All stand on small balls: three feet, which carry the load that statics gives them, or nine under
  a flat bottom. These are soft, and share the load by how deep they sink. MuJoCo lifts a contact
  that slips, the more the faster: where contacts are stiff, a body that spins on nine stands on its
  rim. So the softness of flat bottoms is in the constraint (`YIELD`), which makes that negligible.
"""

from math import ceil
from typing import Any, Final

import mujoco
import numpy as np

from sain_arm.robot.arm_model import compiled, robot_spec
from sain_arm.robot.robot import Robot
from sain_arm.robot.urdf import TIP
from sain_core.scene import Table
from sain_core.shapes.shape import Shape, Solid, prism_surface
from sain_sim.world.parameters import (
    FLOOR_SIZE,
    FOOT_RADIUS,
    PUSHED_AT,
    WorldParameters,
    table_box,
)
from sain_sim.world.workcell import GRAVITY, SAG, TIME_STEP, WorldConfig, support_drop

LONGEST_STEP: Final = 0.002  # [s], [MuJoCo] default of `timestep`; control steps are longer
STIFFEST: Final = 2.0  # [steps], [MuJoCo] smallest time constant of a contact that is stable
CRITICAL: Final = 1.0  # [MuJoCo] default damping ratio of a contact: no bounce
SLIDING_ONLY: Final = 3  # `condim`: no torsional or rolling friction, as in the paper
SERVO_STIFFNESS: Final = 5e5  # [N/m], of the tool on each joint's servo alone
SHORTEST_LEVER: Final = 0.1  # [m], of the tool about a joint, that its servo is made for
# Ten times that of [Menagerie]: with less, light wrists on stiff servos chatter on rigid contacts.
ROTOR_INERTIA: Final = {"hinge": 1.0, "slide": 5.0}  # [kg m^2]; [kg]
YIELD: Final = 100.0  # [1 / mass], regularisation R of a flat bottom's contacts, [MuJoCo] solimp
DAMPING: Final = 90.0  # [1/s], of a flat bottom on the table: a fifth of critical
FRICTION_RATIO: Final = 10.0  # `impratio`: friction of soft contacts creeps at below 1 mm/s
FLOOR_FRICTION: Final = 1.0  # [MuJoCo] default

PHYSICS_STEPS: Final = ceil(TIME_STEP / LONGEST_STEP - 1e-9)  # of MuJoCo, in a control step

BALL, BOX = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX
CYLINDER, PLANE = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_PLANE
TABLE, RIM, TOOL = 1, 2, 4  # bits of what may touch what
# MuJoCo takes the larger friction of two forms, or that of the one with the higher priority. So
# each pair has the friction that is drawn: of table and body, of tool and body, of two bodies.
FEET_FIRST, TABLE_SECOND, TOOL_THIRD, RIMS_LAST = 3, 2, 1, 0


def describe_world(config: WorldConfig, parameters: WorldParameters) -> Any:
    """Return the compiled model of a world; the bodies' places are not part of it.

    Its joints are the robot's, then a free joint for each body that is not fixed.
    """
    table, robot = config.feasibility.table, config.arm
    spec = robot_spec(robot)
    _set_options(spec, parameters)
    _hold_arm(spec, robot)
    ball = spec.body(TIP).add_geom(type=BALL, size=[robot.tool_radius, 0, 0])
    ball.pos = [0.0, 0.0, -config.rise]
    _collide(spec, ball, TOOL, 0, parameters.tool_friction, TOOL_THIRD)
    _yield(ball, parameters.roughness.contact_times[0])
    _add_table(spec, table, parameters.friction)
    for body in range(parameters.count):
        _add_body(spec, body, parameters)
    model = compiled(robot, spec)
    _set_servos(model, robot)
    return model


def _set_options(spec: Any, parameters: WorldParameters) -> None:
    option = spec.option
    # Sparse ones, the default above 60 degrees of freedom (nine bodies), give wrong accelerations
    # in MuJoCo 4.0.0 (its issue 3767).
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.gravity = parameters.roughness.gravity(GRAVITY)
    option.timestep = TIME_STEP / PHYSICS_STEPS
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # [MuJoCo] round cone: friction has no axes
    if parameters.lies_flat:
        option.impratio = FRICTION_RATIO
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST  # [Menagerie]
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # what diverges is reported


def _hold_arm(spec: Any, robot: Robot) -> None:
    """Let nothing of the arm collide, balance its weight, and add servos in the joints' order."""
    for part in (*spec.geoms, *spec.meshes):
        spec.delete(part)
    for body in spec.bodies:
        body.gravcomp = 1.0
    slide = mujoco.mjtJoint.mjJNT_SLIDE
    for name in robot.joints:
        joint = spec.joint(name)
        joint.armature = ROTOR_INERTIA["slide" if joint.type == slide else "hinge"]
        joint.actfrclimited = False
        servo = spec.add_actuator(name=f"servo of {name}", target=name)
        servo.trntype = mujoco.mjtTrn.mjTRN_JOINT
        servo.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE


def _set_servos(model: Any, robot: Robot) -> None:
    """Make servos as stiff at the tool as each other, and damp them critically, as at home."""
    data, count = mujoco.MjData(model), len(robot.joints)
    data.qpos[:count] = robot.home
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, jacobian, None, model.body(TIP).id)
    lever = np.maximum(np.linalg.norm(jacobian[:, :count], axis=0), SHORTEST_LEVER)
    stiffness = SERVO_STIFFNESS * lever**2
    model.actuator_gainprm[:, 0] = stiffness
    model.actuator_biasprm[:, 1] = -stiffness
    model.actuator_biasprm[:, 2] = -2.0 * np.sqrt(stiffness * np.diag(inertia)[:count])


def _add_table(spec: Any, table: Table, friction: float) -> None:
    """Add the table as a box down to the floor, and the floor for what falls."""
    half, middle = table_box(table)
    top = spec.worldbody.add_geom(type=BOX, size=half, pos=middle)
    _collide(spec, top, TABLE, 0, friction, TABLE_SECOND)
    size, place = [FLOOR_SIZE, FLOOR_SIZE, 1.0], [0.0, 0.0, -2 * half[2]]  # planes have no end
    floor = spec.worldbody.add_geom(type=PLANE, size=size, pos=place)
    _collide(spec, floor, TABLE, 0, FLOOR_FRICTION, TABLE_SECOND)


def _add_body(spec: Any, index: int, parameters: WorldParameters) -> None:
    """Add a body; one that nothing moves is set to its place like a free one, but has no joint."""
    shape, radius = parameters.body_shapes[index], parameters.radii[index]
    mass, offset = parameters.masses[index], parameters.mass_offsets[index]
    body = spec.worldbody.add_body(name=f"body{index}")
    if index in parameters.bodies.fixed:
        body.mocap = True
    else:
        body.add_freejoint()
    body.explicitinertial, body.mass = True, mass
    body.ipos = [*offset, 0.0]
    top = float(parameters.tops[index])
    body.inertia = shape.inertia(mass, radius, top)
    drop = support_drop(parameters, index)
    for support, (x, y) in enumerate(parameters.supports(index)):
        foot = body.add_geom(type=BALL, size=[FOOT_RADIUS, 0.0, 0.0], pos=[x, y, drop])
        _collide(spec, foot, 0, TABLE, parameters.friction, FEET_FIRST)
        if parameters.lies_flat:
            _soften(foot, parameters.loads(index)[support])
    height = top - FOOT_RADIUS  # the feet's lower halves are below the body
    place = [0.0, 0.0, FOOT_RADIUS / 2]
    sides = RIM | TOOL
    if shape.solid is Solid.CYLINDER:
        rim = body.add_geom(type=BALL, size=[radius, 0.0, 0.0], pos=[0.0, 0.0, PUSHED_AT - top / 2])
        _collide(spec, rim, RIM, sides, parameters.rim_friction, RIMS_LAST)
        _yield(rim, parameters.roughness.contact_times[1])
        core = body.add_geom(type=CYLINDER, size=[radius, height / 2, 0.0], pos=place)
        _collide(spec, core, 0, TABLE, parameters.friction, RIMS_LAST)
        return
    for part in _parts(spec, body, f"shape{index}", shape, radius, height, place):
        _collide(spec, part, RIM, sides | TABLE, parameters.rim_friction, RIMS_LAST)
        _yield(part, parameters.roughness.contact_times[1])


def _soften(foot: Any, share: float) -> None:
    """Let a support sink by `SAG` under its share of the weight."""
    impedance = 1.0 / (1.0 + YIELD)  # [MuJoCo] R = (1 - d) / d / mass
    stiffness, damping = share * YIELD * GRAVITY / SAG, share * YIELD * DAMPING
    foot.solimp[:2] = impedance, impedance
    foot.solref = [-stiffness * impedance, -damping * impedance]  # negative: not a time constant


def _yield(geom: Any, time: float) -> None:
    """Let contacts with other bodies yield with this time constant [s]; 0: as rigid as before."""
    geom.solref[0] = max(time, geom.solref[0])


def _parts(
    spec: Any, body: Any, name: str, shape: Shape, radius: float, height: float, place: list[float]
) -> list[Any]:
    """Add the box of a cube, or the convex hulls of a prism."""
    if shape.solid is Solid.BOX:
        return [body.add_geom(type=BOX, size=[radius, radius, height / 2], pos=place)]
    geoms = []
    for number, corners in enumerate(shape.parts(radius)):
        points = prism_surface(corners, height).reshape(-1, 3) + place
        hull = spec.add_mesh(name=f"{name}_{number}", uservert=np.unique(points, axis=0).ravel())
        geoms.append(body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=hull.name))
    return geoms


def _collide(spec: Any, geom: Any, own: int, others: int, friction: float, priority: int) -> None:
    """Set what a form touches, and how: as rigid as the time step permits, without bounce."""
    geom.contype, geom.conaffinity = own, others
    geom.condim, geom.priority = SLIDING_ONLY, priority
    geom.friction[0] = friction
    geom.solref = [STIFFEST * spec.option.timestep, CRITICAL]
