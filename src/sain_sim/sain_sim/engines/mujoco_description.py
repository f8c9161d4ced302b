"""What MuJoCo simulates: an arm, a table and bodies. Every number has its source beside it.

Sources: [MuJoCo] its documentation, chapters Computation and XML reference; [Menagerie] the Panda
of github.com/google-deepmind/mujoco_menagerie (``panda_nohand.xml``); [URDF] `sain_sim.arm.panda`,
made from ``pybullet_data``; [Franka] its data sheet. Masses, sizes and friction are drawn.

Contacts are between forms whose normals are exact, at heights that rounding does not change:

* A disk touches tool and disks with a ball of its radius about its middle. Disks that press against
  each other cannot climb, as two of MuJoCo's cylinders do.
* A prism is a convex hull for each part, a cube a box, both upright and of full height.
* All stand on small balls: three feet, which carry the load that statics gives them, or nine under
  a flat bottom. These are soft, and share the load by how deep they sink. MuJoCo lifts a contact
  that slips, the more the faster: where contacts are stiff, a body that spins on nine stands on its
  rim. So the softness of flat bottoms is in the constraint (`YIELD`), which makes that negligible.
"""

from math import ceil
from typing import Any, Final

import mujoco
import numpy as np

from sain_core.scene import DISK_HEIGHT, Table
from sain_core.shapes.shape import Shape, Solid, prism_surface
from sain_sim.arm.motion import JOINT_COUNT, STOCK_TORQUE, TIME_STEP, Joints
from sain_sim.arm.panda import STOCK_INERTIA, TORQUE_SCALE, panda_with_stick
from sain_sim.world.parameters import FLOOR_SIZE, FOOT_RADIUS, WorldParameters, table_box
from sain_sim.world.workcell import GRAVITY, SAG, WorldConfig, support_drop

LONGEST_STEP: Final = 0.002  # [s], [MuJoCo] default of `timestep`; control steps are longer
STIFFEST: Final = 2.0  # [steps], [MuJoCo] smallest time constant of a contact that is stable
CRITICAL: Final = 1.0  # [MuJoCo] default damping ratio of a contact: no bounce
SLIDING_ONLY: Final = 3  # `condim`: no torsional or rolling friction, as in the paper
SERVO_STIFFNESS: Final = np.array([4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0])
"""[N m/rad], [Menagerie] `gainprm`; a multiple of these, as of the torques, holds the arm."""
ROTOR_INERTIA: Final = 0.1  # [kg m^2], [Menagerie] `armature`
YIELD: Final = 100.0  # [1 / mass], regularisation R of a flat bottom's contacts, [MuJoCo] solimp
DAMPING: Final = 90.0  # [1/s], of a flat bottom on the table: a fifth of critical
FRICTION_RATIO: Final = 10.0  # `impratio`: friction of soft contacts creeps at below 1 mm/s
FLOOR_FRICTION: Final = 1.0  # [MuJoCo] default

PHYSICS_STEPS: Final = ceil(TIME_STEP / LONGEST_STEP - 1e-9)  # of MuJoCo, in a control step

BALL, BOX = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX
CYLINDER, PLANE = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_PLANE
STICK: Final = "stick"
SHOULDER: Final = "panda_link1"  # the lowest link that is a body: MuJoCo makes what rests the world
TABLE, RIM, TOOL = 1, 2, 4  # bits of what may touch what
# MuJoCo takes the larger friction of two forms, or that of the one with the higher priority. So
# each pair has the friction that is drawn: of table and body, of tool and body, of two bodies.
FEET_FIRST, TABLE_SECOND, TOOL_THIRD, RIMS_LAST = 3, 2, 1, 0


def describe_world(config: WorldConfig, parameters: WorldParameters, home: Joints) -> Any:
    """Return the compiled model of a world; the bodies' places are not part of it.

    Its joints are the arm's seven, then a free joint for each body that is not fixed.
    """
    table, radius = config.feasibility.table, config.feasibility.limits.tool_radius
    spec = mujoco.MjSpec.from_string(  # [URDF]
        panda_with_stick(radius, STOCK_INERTIA, visuals=False)
    )
    _set_options(spec, parameters)
    _hold_arm(spec, -table.height)
    for geom in spec.geoms:  # of the arm only the stick's end collides
        geom.name = STICK
        _collide(spec, geom, TOOL, 0, parameters.tool_friction, TOOL_THIRD)
        _yield(geom, parameters.roughness.contact_times[0])
    _add_table(spec, table, parameters.friction)
    for body in range(parameters.count):
        _add_body(spec, body, parameters)
    model = spec.compile()
    _damp_servos(model, home)
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


def _hold_arm(spec: Any, base: float) -> None:
    """Place the arm, balance its weight as Franka's controller does, and add servos."""
    spec.body("panda_link0").pos = [0.0, 0.0, base]
    for body in spec.bodies:
        body.gravcomp = 1.0
    for index, joint in enumerate(spec.joints):
        joint.armature = ROTOR_INERTIA
        joint.actfrclimited = False  # the servo has the limit
        stiffness, limit = TORQUE_SCALE * SERVO_STIFFNESS[index], TORQUE_SCALE * STOCK_TORQUE[index]
        servo = spec.add_actuator(name=f"servo{index + 1}", target=joint.name)
        servo.trntype = mujoco.mjtTrn.mjTRN_JOINT
        servo.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        servo.gainprm[0], servo.biasprm[1] = stiffness, -stiffness
        servo.forcelimited, servo.forcerange = True, [-limit, limit]  # [Franka]
    assert len(spec.joints) == JOINT_COUNT


def _damp_servos(model: Any, home: Joints) -> None:
    """Damp each servo critically for the inertia of its joint where the arm is at home."""
    data = mujoco.MjData(model)
    data.qpos[:JOINT_COUNT] = home
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    own = np.diag(inertia)[:JOINT_COUNT]
    model.actuator_biasprm[:, 2] = -2.0 * np.sqrt(model.actuator_gainprm[:, 0] * own)


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
    body.inertia = shape.inertia(mass, radius)
    drop = support_drop(parameters)
    for support, (x, y) in enumerate(parameters.supports(index)):
        foot = body.add_geom(type=BALL, size=[FOOT_RADIUS, 0.0, 0.0], pos=[x, y, drop])
        _collide(spec, foot, 0, TABLE, parameters.friction, FEET_FIRST)
        if parameters.lies_flat:
            _soften(foot, parameters.loads(index)[support])
    height = DISK_HEIGHT - FOOT_RADIUS  # the feet's lower halves are below the body
    place = [0.0, 0.0, FOOT_RADIUS / 2]
    sides = RIM | TOOL
    if shape.solid is Solid.CYLINDER:
        rim = body.add_geom(type=BALL, size=[radius, 0.0, 0.0])
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
        points = prism_surface(corners).reshape(-1, 3) * [1.0, 1.0, height / DISK_HEIGHT] + place
        hull = spec.add_mesh(name=f"{name}_{number}", uservert=np.unique(points, axis=0).ravel())
        geoms.append(body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=hull.name))
    return geoms


def _collide(spec: Any, geom: Any, own: int, others: int, friction: float, priority: int) -> None:
    """Set what a form touches, and how: as rigid as the time step permits, without bounce."""
    geom.contype, geom.conaffinity = own, others
    geom.condim, geom.priority = SLIDING_ONLY, priority
    geom.friction[0] = friction
    geom.solref = [STIFFEST * spec.option.timestep, CRITICAL]
