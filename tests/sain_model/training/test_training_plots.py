"""What a person reads in the pictures of a training and of learning curves."""

import numpy as np

from sain_core.view.palette import PALETTE
from sain_model.evaluation.predictors import BULLET, FLOOR, LEARNED, SAIN, SAIN_HISTORY
from sain_model.training.learning_curve import Point
from sain_model.training.plots import draw_curves, draw_losses
from sain_model.training.trainer import LossHistory


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_losses_are_those_of_the_history():
    history = LossHistory([3.0, 2.0, 1.5], [3.5, 2.25, 2.5], start=4.0)
    figure = draw_losses(history)
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("epoch", "loss, mean over transitions")
    assert legend(figure) == [
        "training", "validation", "kept: epoch 2, 2.25", "validation before the training"
    ]  # fmt: skip
    training, validation, kept, before = axes.lines
    np.testing.assert_array_equal(training.get_xydata(), [[1, 3.0], [2, 2.0], [3, 1.5]])
    np.testing.assert_array_equal(validation.get_ydata(), [3.5, 2.25, 2.5])
    np.testing.assert_array_equal(kept.get_xydata(), [[2, 2.25]])
    assert set(before.get_ydata()) == {4.0}


def test_every_model_of_a_learning_curve_has_its_line_in_the_legend():
    points = [Point(BULLET, 0, 2.7, 2.6, 2.8), Point("planar", 0, 1.7, 1.6, 1.8)]
    points += [Point(FLOOR, 0, 0.02, 0.01, 0.03)]
    for name, mean in ((LEARNED, 4.0), (SAIN, 1.5), (SAIN_HISTORY, 0.9)):
        points += [Point(name, size, mean, 0.9 * mean, 1.1 * mean) for size in (1000, 100)]
    figure = draw_curves(points)
    (axes,) = figure.axes
    assert legend(figure) == [
        "Bullet, nominal (f_p)", "planar", FLOOR,
        *(f"{name}, 95 % band" for name in (LEARNED, SAIN, SAIN_HISTORY)),
    ]  # fmt: skip
    lines = {line.get_label(): line for line in axes.lines}
    assert len({(line.get_color(), line.get_linestyle()) for line in axes.lines}) == len(lines)
    assert lines[f"{SAIN}, 95 % band"].get_color() == PALETTE.predicted  # as in the report page
    np.testing.assert_allclose(
        lines[f"{LEARNED}, 95 % band"].get_xydata(), [[100, 4.0], [1000, 4.0]]
    )
    assert set(lines["planar"].get_ydata()) == {1.7}
    assert [label.get_text() for label in axes.get_xticklabels()] == ["100", "1,000"]
    assert axes.get_ylabel().endswith("[mm]") and axes.get_xlabel() == "training data [transitions]"
