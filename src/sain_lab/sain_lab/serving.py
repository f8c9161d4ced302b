"""What is in service in a laboratory, as a model: ``lab:NAME`` wherever a model has a name."""

from pathlib import Path

from sain_lab.physics import physics_model
from sain_lab.storage.laboratory import PLANAR, PREFIX, SHIPPED, Laboratory
from sain_model.dynamics.load import load_checkpoint, load_shipped
from sain_model.dynamics.priors import make_prior
from sain_model.dynamics.sain import PHYSICS as PHYSICS_KIND
from sain_model.dynamics.sain import Origin, SainDynamics
from sain_model.inference.kinds import friction_belief, read_belief


def load_in_service(name: str) -> SainDynamics:
    """Return what is in service in the laboratory of this name or path.

    Raises `DatasetError`: no laboratory, one of another version, or one copied in part;
    `CheckpointError`: its network or its belief is damaged.
    """
    return in_service(Laboratory.named(name))


def in_service(laboratory: Laboratory) -> SainDynamics:
    """Return the network in service, or the physics as it is believed; raises as above."""
    manifest = laboratory.manifest
    if manifest.has_network:
        return load_checkpoint(laboratory.model_path(manifest.service))
    if manifest.service == PLANAR:
        return planar()
    if manifest.service == SHIPPED:
        return load_shipped()
    return believed(laboratory)


def believed(laboratory: Laboratory) -> SainDynamics:
    """Return the physics as it is believed; raises `CheckpointError`."""
    path = laboratory.belief_path
    return physics_model(read_belief(path)) if path.exists() else load_shipped()


def model_name(path: Path) -> str:
    """Return the name by which other processes load what is in service in a laboratory."""
    return f"{PREFIX}{path.resolve()}"


def planar() -> SainDynamics:
    """Return what all models are compared with: planar physics that infers friction."""
    return SainDynamics(friction_belief(make_prior(PLANAR)), origin=Origin(PHYSICS_KIND, PLANAR))
