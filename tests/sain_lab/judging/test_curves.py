"""The curves of errors, in the chart and on the live page."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time

from sain_lab.judging.chart import draw_curves
from sain_lab.judging.curves import SERVICE, WINDOW, Curves
from sain_lab.ros.learner_node import encode_learning
from sain_lab.storage.laboratory import PHYSICS, PLANAR


@pytest.mark.parametrize("pushes", [1, 7, 59, 333, 2001])
def test_curves_end_with_the_last_push(pushes):
    values = np.random.default_rng(pushes).uniform(1.0, 3.0, pushes)  # [mm]
    curves = Curves(dict.fromkeys((SERVICE, PHYSICS, PLANAR), values), {}, ())
    latest = values[-WINDOW:].mean()
    message = encode_learning(curves, stamp=Time(), laboratory="mine", service="", waiting=0)
    for curve in message.errors:
        assert curve.pushes[-1] == pushes
        assert curve.value[-1] == pytest.approx(1e-3 * latest)
        assert np.isnan([curve.low[-1], curve.high[-1]]).all() == (pushes == 1)
    above = draw_curves(curves).axes[0]
    for line in above.lines[:3]:
        assert line.get_xdata()[-1] == pushes
        assert line.get_ydata()[-1] == pytest.approx(latest)
