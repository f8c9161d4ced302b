"""What is in service in a laboratory, as a model: ``lab:NAME`` wherever a model has a name."""

from pathlib import Path

from sain_lab.physics import physics_model
from sain_lab.storage.laboratory import PHYSICS, PLANAR, PREFIX, SHIPPED, Laboratory
from sain_model.dynamics.load import load_checkpoint, load_shipped
from sain_model.dynamics.priors import load_planar
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import read_belief


def load_in_service(name: str) -> SainDynamics:
    """Return what is in service in the laboratory of this name or path.

    Raises `DatasetError`: no laboratory, one of another version, or one copied in part;
    `CheckpointError`: its network or its belief is damaged.
    """
    laboratory = Laboratory.named(name)
    return load_service(laboratory, laboratory.manifest.service)


def load_service(laboratory: Laboratory, service: str) -> SainDynamics:
    """Return a model of a laboratory by its name in the manifest; raises `CheckpointError`."""
    if service == PHYSICS:
        return believed(laboratory)
    if service == PLANAR:
        return load_planar()
    if service == SHIPPED:
        return load_shipped()
    return load_checkpoint(laboratory.model_path(service))


def believed(laboratory: Laboratory) -> SainDynamics:
    """Return the physics as it is believed; raises `CheckpointError`."""
    path = laboratory.belief_path
    return physics_model(read_belief(path)) if path.exists() else load_shipped()


def model_name(path: Path) -> str:
    """Return the name by which other processes load what is in service in a laboratory."""
    return f"{PREFIX}{path.resolve()}"
