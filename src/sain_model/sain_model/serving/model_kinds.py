"""Which kind a model is, asked without PyTorch: a node that serves physics need not load it."""

from typing import TYPE_CHECKING, TypeGuard

from sain_core.model import Model

if TYPE_CHECKING:
    from sain_model.dynamics.parameter_correction import ParameterCorrection
    from sain_model.dynamics.sain import SainDynamics


def is_learned(dynamics: Model) -> "TypeGuard[SainDynamics | ParameterCorrection]":
    """Return whether a model is a network on a prior."""
    if not hasattr(dynamics, "model_hash"):  # as all that comes from a checkpoint
        return False
    from sain_model.dynamics.parameter_correction import ParameterCorrection

    return is_residual(dynamics) or isinstance(dynamics, ParameterCorrection)


def is_residual(dynamics: Model) -> "TypeGuard[SainDynamics]":
    """Return whether a model corrects what its prior, or another, predicts."""
    if not hasattr(dynamics, "model_hash"):
        return False
    from sain_model.dynamics.sain import SainDynamics

    return isinstance(dynamics, SainDynamics)
