"""What a card says of a model: all its errors on what it was not trained on."""

from typing import Any

from sain_model.data.dataset import Dataset, Split
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.dynamics.sain import LEARNED, SainDynamics
from sain_model.evaluation.open_loop import card_errors
from sain_model.evaluation.prediction_errors import evaluate


def held_out_errors(split: Split | MixedSplit, sain: SainDynamics) -> dict[str, Any]:
    """Return the errors on what was held out, or else on what chose the epoch.

    Where numbers of disks differ: those with the fewest disks, and all under "by_disks".
    """
    errors = {part.disks: _errors(part, sain) for part in held_out_part(split).parts}
    result = dict(errors[min(errors)])
    result["held_out"] = "test" if len(split.test) else "validation"
    if len(errors) > 1:
        result["by_disks"] = {str(disks): part for disks, part in errors.items()}
    return result


def held_out_part(split: Split | MixedSplit) -> Dataset | MixedDataset:
    """Return what errors are measured on: the test part, or without one the validation part."""
    return split.test if len(split.test) else split.validation


def _errors(test: Dataset, sain: SainDynamics) -> dict[str, Any]:
    errors = evaluate(test, learned=sain) if sain.kind == LEARNED else evaluate(test, sain=sain)
    return {**errors, "open_loop": card_errors(test, sain)}
