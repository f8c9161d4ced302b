"""Plan pushes that move the target to a goal beside it, without a robot.

./env python examples/02_plan_a_push.py
"""

import numpy as np

from sain_core.dynamics import StepwiseRollout
from sain_core.scene import make_scene, target_distance
from sain_core.seeding import generator
from sain_model.physics.planar import PlanarPrior
from sain_mppi.planner import Planner

scene = make_scene(
    positions=np.array([[0.45, 0.0], [0.591, 0.0]]),
    masses=np.array([8.0, 8.0]),
    radii=np.array([0.08, 0.06]),
)
goal = np.array([0.50, 0.25])  # to the left: the mid disk must first go round the target

prior = PlanarPrior()
planner = Planner(StepwiseRollout(prior))
for number in range(1, 16):
    distance = float(target_distance(scene, goal))
    if distance < 0.005:
        print(f"target {1e3 * distance:.1f} mm from the goal after {number - 1} pushes")
        break
    plan = planner.plan(scene, goal, generator(7, "example", number))
    location, angle, length = plan.push
    print(
        f"push {number}: location {location:+.2f} rad, angle {angle:+.2f} rad,"
        f" {100 * length:4.1f} cm; target {1e3 * distance:5.1f} mm from the goal"
    )
    scene = prior.step(scene[None], plan.push[None])[0]  # in place of a real push
else:
    raise SystemExit(f"15 pushes left the target {1e3 * target_distance(scene, goal):.0f} mm off")
