"""What a push costs and how true the tool runs: ``./env python -m benchmarks.sim_push``.

Randomised pushes with the arm, motion without contact left out and in full, beside Bullet
without an arm. Times are CPU time of one core.
"""

import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from benchmarks.report import Figure, report
from sain_core.errors import SainError
from sain_core.push import TOOL_RADIUS
from sain_core.scene import DISK_HEIGHT, SETTLED_SPEED, SETTLED_SPIN
from sain_core.seeding import generator
from sain_core.types import PushArray, Scene
from sain_sim.arm.client import Client
from sain_sim.arm.motion import MotionConfig
from sain_sim.camera.render import CameraConfig, Renderer
from sain_sim.collecting.episode import draw_circle_push
from sain_sim.engines.bullet.bodies import Body, resting
from sain_sim.world.parameters import (
    WorldParameters,
    nominal_parameters,
    sample_parameters,
    table_box,
)
from sain_sim.world.start import draw_start
from sain_sim.world.stroke import Stroke
from sain_sim.world.workcell import GRAVITY, STEPS_PER_LOOK, Sample, WorldConfig
from sain_sim.world.world import World

Case = tuple[WorldParameters, Scene, PushArray]


@dataclass(frozen=True)
class Options:
    """How much to measure."""

    pushes: int = 200
    """pushes of each kind"""
    pictures: int = 5
    """pictures of each size"""
    seed: int = 0
    """of the pushes"""
    out: Path | None = None
    """write the figures to this JSON file"""


def cases(options: Options) -> list[Case]:
    """Draw randomised worlds, starts and pushes that can be carried out."""
    random = generator(options.seed, "benchmark")
    table = WorldConfig().feasibility.table
    drawn: list[Case] = []
    with World(nominal_parameters()) as world:
        while len(drawn) < options.pushes:
            parameters = sample_parameters(random)
            start = draw_start(random, parameters, table)
            push = draw_circle_push(random, start, parameters.bodies)
            world.load(start, parameters)
            try:
                world.push(push)
            except SainError:
                continue
            drawn.append((parameters, start, push))
    return drawn


def push_time(drawn: list[Case], full_motion: bool) -> float:
    """Return the CPU time of a push with the arm [ms]."""
    spent = 0.0
    with World(nominal_parameters(), WorldConfig(full_motion=full_motion)) as world:
        for parameters, start, push in drawn:
            world.load(start, parameters)
            begun = time.process_time()
            world.push(push)
            spent += time.process_time() - begun
    return 1e3 * spent / len(drawn)


def tracking(drawn: list[Case]) -> np.ndarray:
    """Return the tool's errors along, across and in height [mm], one row for each push step."""
    errors: list[np.ndarray] = []
    heading = 0.0

    def note(sample: Sample) -> None:
        if sample.phase == "push":
            offset = 1e3 * (sample.tool - sample.commanded_tool)
            cos, sin = np.cos(heading), np.sin(heading)
            along, across = cos * offset[0] + sin * offset[1], cos * offset[1] - sin * offset[0]
            errors.append(np.abs([along, across, offset[2]]))

    with World(nominal_parameters()) as world:
        for parameters, start, push in drawn:
            world.load(start, parameters)
            heading = world.check(push).heading
            world.push(push, on_step=note)
    return np.array(errors)


def armless_push(client: Client, case: Case) -> None:
    """Push with a bare cylinder that is moved along: Bullet without an arm."""
    parameters, start, push = case
    config, motion = WorldConfig(), MotionConfig()
    limits, table = config.feasibility.limits, config.feasibility.table
    client.resetSimulation()
    client.setGravity(0.0, 0.0, -GRAVITY)
    client.setTimeStep(motion.time_step)
    client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
    half, middle = table_box(table)
    top = client.createCollisionShape(client.GEOM_BOX, halfExtents=half)
    own = parameters.rim_friction**0.5  # Bullet multiplies the friction of two bodies
    client.changeDynamics(
        client.createMultiBody(0.0, top, basePosition=middle),
        -1,
        lateralFriction=parameters.friction / own,
    )
    bodies = [
        Body(client, parameters, index, resting(client, state), own)
        for index, state in enumerate(start)
    ]
    shape = client.createCollisionShape(
        client.GEOM_CYLINDER, radius=TOOL_RADIUS, height=DISK_HEIGHT
    )
    tool = client.createMultiBody(100.0, shape)
    stroke = Stroke.of_push(start, push, limits)
    for position, velocity in _stroke_states(stroke, motion):
        client.resetBasePositionAndOrientation(tool, position, [0, 0, 0, 1])
        client.resetBaseVelocity(tool, velocity, [0, 0, 0])
        client.stepSimulation()
    client.removeBody(tool)
    for step in range(1, round(config.max_settle_time / motion.time_step)):
        client.stepSimulation()
        if step % STEPS_PER_LOOK == 0 and all(map(_is_still, bodies)):
            return


def _is_still(body: Body) -> bool:
    *_, vx, vy, spin = body.planar(body.state())
    return bool(np.hypot(vx, vy) < SETTLED_SPEED and abs(spin) < SETTLED_SPIN)


def _stroke_states(stroke: Stroke, motion: MotionConfig) -> Iterator[tuple[list, list]]:
    middle = np.array([0.0, 0.0, DISK_HEIGHT / 2])
    tips = motion.stroke(stroke.start, stroke.end, stroke.speed) + middle
    speeds = np.diff(tips, axis=0) / motion.time_step
    yield from zip(tips[:-1].tolist(), speeds.tolist(), strict=True)


def armless_rate(drawn: list[Case]) -> float:
    """Return pushes a second of Bullet without an arm."""
    with closing(Client()) as client:
        begun = time.process_time()
        for case in drawn:
            armless_push(client, case)
        return len(drawn) / (time.process_time() - begun)


def build_time() -> float:
    """Return the CPU time to build a world [ms]."""
    begun = time.process_time()
    for _ in range(10):
        World(nominal_parameters()).close()
    return 1e3 * (time.process_time() - begun) / 10


def picture_rate(width: int, height: int, count: int) -> float:
    """Return pictures a second, smoothed edges included."""
    scene = nominal_parameters().scene(np.array([[0.45, 0.0], [0.6, 0.0]]))
    joints = WorldConfig().kinematics.joints(np.array([0.34, 0.0, 0.012]))
    with Renderer(scene, camera=CameraConfig(width=width, height=height)) as renderer:
        begun = time.process_time()
        for _ in range(count):
            renderer.picture(joints, scene, np.array([0.8, 0.0]))
        return count / (time.process_time() - begun)


def main() -> None:
    """Measure what a push in the simulator costs, and how true the tool runs."""
    options = tyro.cli(Options, description=main.__doc__)
    drawn = cases(options)
    short = push_time(drawn, full_motion=False)
    errors = tracking(drawn)
    figures = [
        Figure("push with the arm, contact-free motion left out", short, "ms", at_most=25.0),
        Figure("push with the arm, in full", push_time(drawn, True), "ms", at_most=45.0),
        Figure("pushes with the arm", 1e3 / short, "/s"),
        Figure("pushes of Bullet without an arm", armless_rate(drawn), "/s"),
        Figure("world built", build_time(), "ms"),
    ]
    for axis, name in enumerate(("along the push", "across it", "in height")):
        median, most = np.percentile(errors[:, axis], [50, 99])
        figures.append(Figure(f"tool off its line {name}, p50", median, "mm"))
        figures.append(Figure(f"tool off its line {name}, p99", most, "mm", at_most=1.5))
    for width, height in ((960, 540), (480, 270)):
        rate = picture_rate(width, height, options.pictures)
        figures.append(Figure(f"pictures of {width} x {height}", rate, "/s"))
    report("Simulator", figures, options.out)


if __name__ == "__main__":
    main()
