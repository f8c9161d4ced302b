"""Beliefs as JSON cards."""

from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from sain_core.config import typed_settings
from sain_core.errors import CheckpointError
from sain_core.storage import write_json
from sain_core.untrusted import read_json
from sain_model.identification.beliefs import Belief
from sain_model.identification.parameters import COUNT
from sain_model.identification.structures import Structure
from sain_model.physics.friction import FrictionConfig
from sain_model.physics.planar_config import PlanarConfig

FORMAT: Final = "sain-belief-2"


def write_belief(path: Path, belief: Belief) -> Path:
    """Write a belief; raises `OutputError`."""
    content = {
        "format": FORMAT,
        **belief.card,
        "network_log_odds": belief.network_log_odds,
        "structures": [_written(structure) for structure in belief.structures],
    }
    return write_json(path, content)


def read_belief(path: Path) -> Belief:
    """Read a belief.

    Raises:
        CheckpointError: no such file, or not a belief.
    """
    try:
        content = read_json(path)
        if content.pop("format") != FORMAT:
            raise ValueError("it is of another version")
        structures = tuple(_read(part) for part in content.pop("structures"))
        odds = float(content.pop("network_log_odds"))
        if not structures:
            raise ValueError("no structures")
    except FileNotFoundError:
        raise CheckpointError(
            f"belief {path} does not exist; sain_model identify makes one"
        ) from None
    except (OSError, ValueError, LookupError, TypeError, AttributeError, OverflowError) as error:
        raise CheckpointError(
            f"belief {path} cannot be read: {error}; make it again with sain_model identify"
        ) from error
    return Belief(structures, odds, card=content)


def _written(structure: Structure) -> dict[str, Any]:
    deviations = np.sqrt(np.diag(structure.covariance))
    parameters = [
        {
            "name": parameter.name,
            "meaning": parameter.meaning,
            "mean": getattr(structure.config, parameter.name),
            "spread": float(parameter.spread * deviation),
            "spread_is": "of the logarithm" if parameter.logarithm else "of the value",
        }
        for parameter, deviation in zip(structure.parameters, deviations.tolist(), strict=True)
    ]
    return {
        "name": structure.name,
        "log_odds": structure.log_odds,
        "corrected": structure.corrected,
        "parameters": parameters,
        "config": asdict(structure.config),
        "friction": asdict(structure.friction),
        "covariance": structure.covariance.tolist(),
    }


def _read(part: dict[str, Any]) -> Structure:
    covariance = np.array(part["covariance"], dtype=np.float64)
    allowed = [(count, count) for count in (COUNT, COUNT + 1)]  # without and with masses
    if covariance.shape not in allowed or not np.isfinite(covariance).all():
        raise ValueError(
            f"a covariance has shape {covariance.shape}; allowed: {allowed[0]} or {allowed[1]},"
            " finite"
        )
    if np.linalg.eigvalsh(covariance)[0] <= 0.0:
        raise ValueError("a covariance is not positive")
    return Structure(
        str(part["name"]),
        PlanarConfig(**typed_settings(PlanarConfig, part["config"])),
        covariance,
        FrictionConfig(**typed_settings(FrictionConfig, part["friction"])),
        float(part["log_odds"]),
        bool(part["corrected"]),
    )
