"""Bullet as a dynamics that other packages find by name.

`sain_core.model` finds it under ``bullet`` (the paper's f_p: nominal masses, radii and friction)
and ``bullet_measured`` (masses and radii of the scene, nominal friction). Each name that is asked
for builds a world of its own, which `close` lets go of. All bodies are disks on three feet: a scene
does not state shapes.
"""

from typing import Final

from sain_core.errors import ConfigError, UnreachableError
from sain_core.types import PushArray, Scene
from sain_sim.world.shadow import MEASURED, NOMINAL, BulletPrior

KINDS: Final = {"bullet": NOMINAL, "bullet_measured": MEASURED}


class Bullet(BulletPrior):
    """A shadow that goes on where its arm cannot: after predictions, not after what was seen.

    In a scene that was predicted the mid disk may stand where the arm does not reach. A world
    refuses such a push, and nothing moves: so it is predicted, and counted.
    """

    _refused = 0

    @property
    def refused(self) -> int:
        """How many pushes the arm could not carry out so far."""
        return self._refused

    def predict(self, scene: Scene, push: PushArray) -> Scene:
        """Predict the settled scene (N, 8) after one push (5,) from a scene (N, 8)."""
        try:
            return super().predict(scene, push)
        except UnreachableError:
            self._refused += 1
            return scene.copy()


def load_bullet(name: str) -> Bullet:
    """Return Bullet by one of its names.

    Raises:
        ConfigError: there is none of that name.
    """
    if name not in KINDS:
        raise ConfigError(f"no dynamics {name!r} in the simulator; known: {', '.join(KINDS)}")
    return Bullet(KINDS[name])
