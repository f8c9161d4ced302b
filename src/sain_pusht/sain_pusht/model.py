"""Models of gym-pusht by name: the shipped one, its prior alone, the oracle, or any other."""

from importlib import resources
from pathlib import Path
from typing import Final, NamedTuple

from sain_core.errors import CheckpointError
from sain_core.model import RolloutModel, load_dynamics
from sain_core.shapes.bodies import Bodies
from sain_model.dynamics.checkpoint import read_card
from sain_model.dynamics.load import load_sain
from sain_pusht.block import pusht_bodies
from sain_pusht.oracle import PushtOracle
from sain_pusht.walls import InsideWalls

GYRATION: Final = "gyration"  # on cards, of the block [radii]
SHIPPED: Final = "pusht"
PRIOR: Final = "prior"
ORACLE: Final = "oracle"
CHECKPOINT: Final = Path(str(resources.files("sain_pusht") / "pusht.safetensors"))


class PushtModel(NamedTuple):
    """What plans, what replaces it where it fails, and the block as they know it."""

    model: RolloutModel
    physics: RolloutModel
    bodies: Bodies


def load_model(name: str) -> PushtModel:
    """Return a model by its name: pusht, prior, oracle, or as in `sain_core.model`.

    Raises:
        ConfigError: an unknown name, or gym-pusht is not installed.
        CheckpointError: a checkpoint that cannot be loaded.
    """
    shipped = load_sain(CHECKPOINT)
    bodies = learned_bodies(CHECKPOINT)
    physics = InsideWalls(shipped.prior, bodies)
    if name == PRIOR:
        return PushtModel(physics, physics, bodies)
    if name == ORACLE:
        return PushtModel(PushtOracle(), physics, bodies)
    model = shipped if name == SHIPPED else load_dynamics(name)
    if name != SHIPPED:
        bodies = learned_bodies(Path(name)) if Path(name).exists() else pusht_bodies()
    return PushtModel(InsideWalls(model, bodies), physics, bodies)


def learned_bodies(path: Path) -> Bodies:
    """Return the block as a checkpoint was trained on it; uniform where its card tells nothing.

    Raises:
        CheckpointError: its card cannot be read.
    """
    gyration = read_card(path).data.get(GYRATION, 0.0)
    if not isinstance(gyration, (int, float)) or gyration < 0.0:
        raise CheckpointError(f"{GYRATION} on the card of {path} is {gyration!r}; it must be >= 0")
    return pusht_bodies(float(gyration))
