"""The shadow world for bodies of any shape and role."""

from dataclasses import replace

from sain_core.scene import POSITION, THETA
from sain_core.types import PushArray, Scene
from sain_sim.world.parameters import NOMINAL_MASS, WorldParameters
from sain_sim.world.shadow import MEASURED, TRUE, BulletPrior
from sain_sim.world.stroke import Stroke, is_idle


class NominalShadow(BulletPrior):
    """A `BulletPrior` that also predicts pushes against bodies that are no disks.

    Their size is part of their shape, and contacts lie within the circumscribed circle. So a
    shadow of such bodies has the radii of the scene, and only masses and friction are nominal.
    """

    def predict(self, scene: Scene, push: PushArray) -> Scene:
        """Predict the settled scene (N, 8) after one push (5,) from a scene (N, 8)."""
        truth = self.truth
        if truth is None or is_idle(push) or is_plain(truth):
            return super().predict(scene, push)
        parameters = self._with_shapes(scene, truth)
        start = parameters.scene(scene[:, POSITION], scene[:, THETA])
        limits = self._world.config.feasibility.limits
        stroke = Stroke.of_push(scene, push, limits, truth.bodies)
        return self._moved(scene, start, parameters, stroke)

    def _with_shapes(self, scene: Scene, truth: WorldParameters) -> WorldParameters:
        if self.kind == TRUE:
            return truth
        measured = WorldParameters.of_scene(scene, shapes=truth.shapes, roles=truth.roles)
        if self.kind == MEASURED:
            return measured
        return replace(measured, masses=(NOMINAL_MASS,) * len(scene))


def is_plain(parameters: WorldParameters) -> bool:
    """Tell whether bodies are disks and cubes with the paper's roles, the first a disk."""
    bodies = parameters.bodies
    stands_in = all(shape.is_round or shape.circumradius > 1.0 for shape in bodies.shapes)
    return bodies.has_paper_roles and stands_in and bodies.shapes[0].is_round
