"""What a person reads in the picture of open loops."""

import numpy as np
import pytest

from sain_core.scene import POSITION
from sain_core.view.palette import PALETTE
from sain_model.data.dataset import Part
from sain_model.data.windows import Windows
from sain_model.evaluation.predictors import Predictions
from sain_model.evaluation.rollout_plot import KINDS, draw_rollouts

WINDOWS, STEPS = 6, 4


@pytest.fixture
def figure():
    """Each kind errs by its place in the legend [mm], times the number of pushes."""
    truth = np.zeros((WINDOWS, STEPS, 2, 8))
    predictions = {}
    for place, name in enumerate(KINDS, start=1):
        predictions[name] = truth.copy()
        for step in range(STEPS):
            predictions[name][:, step, :, POSITION.start] = 1e-3 * place * (step + 1)
    rows = np.arange(WINDOWS * STEPS).reshape(WINDOWS, STEPS)
    pushes, episodes = np.ones((WINDOWS, STEPS, 5)), np.arange(WINDOWS) // 2
    windows = Windows(rows, truth[:, 0], pushes, truth, episodes)
    row, none = truth[:, 0], np.zeros(WINDOWS)
    part = Part(row, np.ones((WINDOWS, 5)), row, row, episodes, episodes, none, row)
    loop = Predictions(part, windows, predictions, {}, np.zeros(WINDOWS, int))
    return draw_rollouts([loop], 0)


def test_curves_are_the_mean_errors(figure):
    for axes in figure.axes:
        for place, line in enumerate(axes.lines, start=1):
            np.testing.assert_allclose(line.get_ydata(), place * np.arange(1, STEPS + 1))
    assert [axes.get_title("left") for axes in figure.axes] == ["target", "body 0"]


def test_every_curve_is_in_the_legend_and_has_its_last_value(figure):
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == [label for label, _ in KINDS.values()]
    for axes in figure.axes:
        labels = {text.get_color(): text.get_text() for text in axes.texts}
        assert labels[PALETTE.physics] == "4 mm" and labels[PALETTE.history] == "16 mm"


def test_the_title_counts_windows_and_episodes(figure):
    assert figure.get_suptitle() == "6 rollouts of 4 pushes, 3 held-out episodes; bands: 95 %"
    assert {axes.get_ylabel() for axes in figure.axes} == {"mean position error [mm]"}
