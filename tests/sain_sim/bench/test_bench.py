"""The table of a bench: bodies of a file, an arm that follows, and a report of what it breaks."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from sain_arm.planning.push_events import Ended
from sain_arm.planning.push_planner import PushPlanner
from sain_arm.planning.timing import Trajectory
from sain_core.errors import ConfigError
from sain_core.feasibility import Stroke
from sain_core.push import PushLimits
from sain_core.scene import POSE, POSITION
from sain_core.shapes.library import get_shape
from sain_core.types import Scene
from sain_sim.bench.bench import Bench, BenchConfig
from sain_sim.bench.report import Report
from sain_sim.world.engines import ENGINES, MUJOCO, is_installed
from sain_sim.world.truth import MEASURED
from sain_sim.world.workcell import WorldConfig

T = {"shape": "t:flat", "radius": 0.08, "role": "movable", "mass": 0.7}
PUCK = {"shape": "disk:flat", "radius": 0.05, "role": "pushable", "mass": 0.5}


def bench_of(path: Path, *rows: dict, **config) -> Bench:
    path.write_text(yaml.safe_dump({"bodies": list(rows)}))
    given = {"cell": WorldConfig(robot="ur5", motion=BenchConfig().cell.motion)} | config
    return Bench(BenchConfig(bodies=str(path), **given))


@pytest.mark.parametrize(
    ("engine", "height"), [*((name, 0.04) for name in ENGINES if is_installed(name)), (MUJOCO, 0.1)]
)
def test_a_bench_follows_planned_pushes_and_breaks_nothing(engine, height, tmp_path):
    """The second push is from the other side: the arm travels around the disk."""
    place = (0.5, 0.0, 0.3, 0.5, 0.25, 0.0)
    rows = [row | {"height": height} for row in (PUCK, T)]
    bench = bench_of(tmp_path / "b.yaml", *rows, place=place, engine=engine)
    before = bench.observe()
    np.testing.assert_allclose(before[:, POSE].ravel(), place, atol=1e-6)
    bodies, limits = bench.bodies.bodies, PushLimits(tool_radius=bench.robot.tool_radius)
    planner = PushPlanner(bench.robot, bodies, bench.bodies.radii)
    for location in (0.0, 3.0):
        start = bench.observe()
        push = np.array([0.0, location, 0.0, 0.06, 0.2])
        stroke = Stroke.of_push(start, push, limits, bodies)
        plan = planner.plan(stroke, start, bench.joints)
        follow(bench, plan.approach)
        assert travel(bench, start) == pytest.approx([0.0, 0.0], abs=1e-4)
        follow(bench, plan.stroke)
        for _ in range(120):  # the disk slides on
            bench.step()
        assert 0.03 < travel(bench, start)[0] < 0.08 and travel(bench, start)[1] < 1e-3
    report = bench.report
    assert (dict(report.limits), dict(report.contacts)) == ({}, {}) and report.tool > 2
    joints = bench.joints
    bench.place(before[:, POSE])
    np.testing.assert_allclose(bench.observe()[:, POSE], before[:, POSE], atol=1e-6)
    np.testing.assert_allclose(bench.joints, joints, atol=1e-3)
    bench.close()


def follow(bench: Bench, goal: Trajectory) -> None:
    assert not bench.controller.rejects()
    bench.controller.start(goal, bench.time)
    while (ending := bench.step()) is None:
        pass
    assert ending.how is Ended.SUCCEEDED, ending


def travel(bench: Bench, start: Scene) -> np.ndarray:
    return np.linalg.norm((bench.observe() - start)[:, POSITION], axis=1)


def test_what_a_file_hides_is_drawn_from_the_seed_and_the_world(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outline = tmp_path / "mug.yaml"
    corners = [[0.04, 0.03], [-0.04, 0.03], [-0.04, -0.03], [0.05, -0.03]]
    outline.write_text(yaml.safe_dump({"unit": "m", "shapes": {"mug": corners}}))
    hidden = {key: value for key, value in T.items() if key != "mass"}
    rows = [hidden, {**PUCK, "shape": "mug.yaml:flat"}]
    draws = []
    for seed in (0, 0, 1):
        bench = bench_of(
            tmp_path / "b.yaml", *rows, seed=seed, lab=seed, world=MEASURED, engine="mujoco"
        )
        draws.append(parameters := bench.world.parameters)
        bench.close()
        assert parameters.radii == (0.08, 0.05)
        assert parameters.body_shapes[1] is get_shape(parameters.shapes[1])
        assert all(0.4 < mass < 1.2 for mass in parameters.masses)
        assert parameters.roughness.pressures and parameters.roughness.mass_offset(0)
    assert draws[0] == draws[1] != draws[2]


def test_places_that_do_not_fit_the_bodies_are_refused(tmp_path):
    with pytest.raises(ConfigError, match="place has 3 numbers; 2 bodies need 6"):
        bench_of(tmp_path / "b.yaml", T, PUCK, place=(0.5, 0.0, 0.0), engine="mujoco")


def test_a_report_counts_limits_links_and_the_table(tmp_path):
    bench = bench_of(tmp_path / "b.yaml", PUCK, place=(0.5, 0.0, 0.0), engine="mujoco")
    robot, scene = bench.robot, bench.observe()
    report = Report(robot, bench.bodies.bodies, bench.bodies.radii)
    still = np.zeros(6)
    report.look(robot.home, still, scene)
    assert not report.limits and not report.contacts and not report.tool
    report.look(robot.home, 1.1 * robot.velocity, scene)
    assert set(report.limits) == set(robot.joints)
    down = robot.home.copy()
    down[1] += 1.2  # the forearm goes into the table
    report.look(down, still, scene)
    assert any("sain_table" in names for names in report.contacts)
    bench.close()
