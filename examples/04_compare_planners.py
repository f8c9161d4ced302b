"""Plan the same scene with every algorithm, and draw what each found: planners.png.

./env python examples/04_compare_planners.py
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sain_core.scene import make_scene
from sain_core.seeding import generator
from sain_eval.plots.pictures import save_picture
from sain_eval.plots.plan_picture import draw_plan
from sain_model.dynamics.load import load_sain, shipped_checkpoint
from sain_mppi.algorithms import ALGORITHMS
from sain_mppi.planner import Planner
from sain_mppi.search.config import PlannerConfig

scene = make_scene(
    positions=np.array([[0.45, 0.0], [0.591, 0.0]]),
    masses=np.array([8.0, 8.0]),
    radii=np.array([0.08, 0.06]),
)
goal = np.array([0.50, 0.25])  # to the left: the mid disk must first go round the target
sain = load_sain(shipped_checkpoint())

figure = Figure(figsize=(3.0 * len(ALGORITHMS), 3.5))
figure.subplots_adjust(left=0.005, right=0.995, bottom=0.01, top=0.86, wspace=0.03)
for axes, name in zip(figure.subplots(1, len(ALGORITHMS)), ALGORITHMS, strict=True):
    planner = Planner(sain, replace(PlannerConfig(), algorithm=name))
    planner.plan(scene, goal, generator(7, name))  # what is loaded and compiled once
    planner.reset()
    plan = planner.complete(scene, planner.plan(scene, goal, generator(7, name)))
    draw_plan(axes, scene, goal, plan)
    axes.set(xlim=(0.28, 0.83), ylim=(-0.22, 0.33))  # the same for all
    axes.set_title(f"{name}\ncost {plan.cost:.2f}, {plan.samples} sequences", fontsize=10)
    worst = max(plan.terms, key=plan.terms.__getitem__)
    print(
        f"{name:12} cost {plan.cost:5.2f} (doing nothing: {plan.rest_cost:.2f}; most of it:"
        f" {worst}), {plan.samples} sequences in {1e3 * plan.times.total:.0f} ms"
    )
print(f"drawn into {save_picture(figure, Path('planners.png'))}")
