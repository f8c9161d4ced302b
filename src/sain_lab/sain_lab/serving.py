"""What is in service in a laboratory, as a model: ``lab:NAME`` wherever a model has a name."""

from dataclasses import replace
from pathlib import Path

from sain_lab.storage.laboratory import PHYSICS, PLANAR, PREFIX, SHIPPED, Laboratory
from sain_model.dynamics.load import load_checkpoint, load_shipped
from sain_model.dynamics.priors import load_planar
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import Belief, read_belief


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
    network = load_checkpoint(laboratory.model_path(service))
    if not laboratory.belief_path.exists():
        return network
    return on_belief(network, read_belief(laboratory.belief_path))


def on_belief(network: SainDynamics, belief: Belief) -> SainDynamics:
    """Return a network of a laboratory on the physics that is believed there now.

    It stays on its own physics where another kind has become the likeliest.
    """
    kind = replace(belief.likeliest, corrected=True)
    if kind.of_bodies or kind.has_axes != network.belief.trained.has_axes:
        return network
    return network.believing(Belief((kind,)))


def believed(laboratory: Laboratory) -> SainDynamics:
    """Return the physics as it is believed; raises `CheckpointError`."""
    if not laboratory.belief_path.exists():
        return load_shipped()
    belief = read_belief(laboratory.belief_path)
    return SainDynamics(belief) if belief.likeliest.of_bodies else load_shipped().believing(belief)


def model_name(path: Path) -> str:
    """Return the name by which other processes load what is in service in a laboratory."""
    return f"{PREFIX}{path.resolve()}"
