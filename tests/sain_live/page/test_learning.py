"""What the page shows of a laboratory."""

import numpy as np

from sain_core.wire.learning import Learned, LearnedCurve
from sain_live.page.learning import error_data, learning_text


def curve(name, pushes, *rows, unit="m"):
    return LearnedCurve(name, unit, np.array(pushes), np.array(rows, float).reshape(-1, 3))


LEARNED = Learned(
    "<b>mine",
    "physics",
    9,
    (
        curve("planar", [1, 9], (0.002, 0.001, 0.003), (0.004, 0.003, 0.005)),
        curve("physics", [9], (0.001, 0.0005, 0.0015)),
    ),
    (curve("friction", [2, 9], (0.1, 0.0, 0.4), (0.2, 0.15, 0.25), unit=""),),
    ((7, "loaded", "<script>"),),
)


def test_all_curves_share_their_places_and_are_in_millimetres():
    at, *columns = error_data(LEARNED)
    assert at.tolist() == [0, 1, 9] and len(columns) == 9
    np.testing.assert_allclose(columns[0], [np.nan, 2.0, 4.0])
    np.testing.assert_allclose(columns[4], [np.nan, np.nan, 0.5])
    assert np.isnan(columns[6:]).all()  # nothing was in service


def test_texts_of_strangers_are_text():
    shown = learning_text(LEARNED)
    assert "<script>" not in shown and "<b>mine" not in shown
    assert "&lt;script&gt;" in shown
