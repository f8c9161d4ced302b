"""Push a disk with the simulated arm and compare the result with the planar prior's prediction.

./env python examples/01_push_a_disk.py
"""

import numpy as np

from sain_core.push import make_push
from sain_core.scene import MID, POSITION, TARGET, make_scene
from sain_model.physics.planar import PlanarPrior
from sain_sim.world.world import World

# Two disks that touch (1 mm apart), the target ahead of the mid disk. SI units throughout.
scene = make_scene(
    positions=np.array([[0.45, 0.0], [0.591, 0.0]]),
    masses=np.array([8.0, 8.0]),
    radii=np.array([0.08, 0.06]),
)
friction = 0.12
push = make_push(location=0.0, angle=0.1, length=0.10)  # from behind, 0.1 rad to the left, 10 cm

with World.of_scene(scene, friction) as world:
    outcome = world.push(push)

predicted = PlanarPrior().step(scene[None], push[None])[0]

for name, disk in (("mid", MID), ("target", TARGET)):
    moved = 1e3 * (outcome.after - outcome.before)[disk, POSITION]
    error = 1e3 * np.linalg.norm(predicted[disk, POSITION] - outcome.after[disk, POSITION])
    print(f"{name:6s} moved ({moved[0]:.1f}, {moved[1]:.1f}) mm; error of the prior {error:.1f} mm")
