"""Beliefs as JSON cards."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from sain_core.config import typed_settings
from sain_core.errors import CheckpointError
from sain_core.guarding.untrusted import read_json
from sain_core.storage import write_json
from sain_model.inference.kinds import Belief, Kind
from sain_model.physics.parameters import BY_NAME
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import PlanarConfig

FORMAT: Final = "sain-belief-3"  # before: with a fixed set of parameters
COMMAND: Final = "ros2 run sain_model identify"


def write_belief(path: Path, belief: Belief) -> Path:
    """Write a belief; raises `OutputError`."""
    content = {
        "format": FORMAT,
        **belief.card,
        "network_log_odds": belief.network_log_odds,
        "kinds": [written_kind(kind) for kind in belief.kinds],
    }
    return write_json(path, content)


def read_belief(path: Path) -> Belief:
    """Read a belief.

    Raises:
        CheckpointError: no such file, not a belief, or one of an earlier version.
    """
    try:
        content = read_json(path)
        if (found := content.pop("format")) != FORMAT:
            raise ValueError(f"its format is {found!r}; this version reads {FORMAT!r}")
        kinds = tuple(read_kind(part) for part in content.pop("kinds"))
        odds = float(content.pop("network_log_odds"))
        if not any(kind.corrected for kind in kinds):
            raise ValueError("no kind of physics is that of the network")
    except FileNotFoundError:
        raise CheckpointError(f"belief {path} does not exist; make it with: {COMMAND}") from None
    except (OSError, ValueError, LookupError, TypeError, AttributeError, OverflowError) as error:
        raise CheckpointError(
            f"belief {path} cannot be read: {error}; make it again with: {COMMAND}"
        ) from error
    return Belief(kinds, odds, card=content)


def written_kind(kind: Kind) -> dict[str, Any]:
    """Return a kind of physics as JSON has it."""
    parameters = [
        {
            "name": parameter.name,
            "meaning": parameter.meaning,
            "mean": getattr(kind.config, parameter.name),
            "spread": float(parameter.spread * deviation),
            "spread_is": "of the logarithm" if parameter.logarithm else "of the value",
        }
        for parameter, deviation in zip(kind.parameters, kind.deviations, strict=True)
    ]
    return {
        "name": kind.name,
        "log_odds": kind.log_odds,
        "corrected": kind.corrected,
        "of_bodies": kind.of_bodies,
        "parameters": parameters,
        "config": asdict(kind.config),
        "covariance": kind.covariance.tolist(),
    }


def read_kind(part: dict[str, Any]) -> Kind:
    """Return a kind that `written_kind` wrote; raises what damaged values raise."""
    names = tuple(str(parameter["name"]) for parameter in part["parameters"])
    if unknown := [name for name in names if name not in BY_NAME]:
        raise ValueError(f"there is no parameter {unknown[0]!r}")
    covariance = np.array(part["covariance"], dtype=np.float64)
    right = len(names), len(names)
    if covariance.shape != right or not np.isfinite(covariance).all():
        raise ValueError(f"a covariance has shape {covariance.shape}; allowed: {right}, finite")
    if np.linalg.eigvalsh(covariance)[0] <= 0.0:
        raise ValueError("a covariance is not positive")
    config = PlanarConfig(**typed_settings(PlanarConfig, part["config"]))
    odds, corrected = float(part["log_odds"]), bool(part["corrected"])
    of_bodies = bool(part.get("of_bodies", False))
    prior = PlanarPrior(config)
    kind = Kind(str(part["name"]), prior, names, covariance, odds, corrected=corrected)
    return replace(kind, of_bodies=of_bodies)
