"""Radii of disks that are not measured."""

import numpy as np
import pytest

from sain_core.push import PushLimits, make_push, tool_end, tool_start
from sain_core.scene import MID, POSITION, RADIUS, TARGET, make_scene
from sain_core.transitions import PushHistory
from sain_mppi.agent.estimator import BEFOREHAND, RadiusFilter, resized_push

LIMITS = PushLimits()
PUSH = make_push(0.3, 0.2, 0.12)
NOISE = np.full(2, 5e-4)


def resized(scene, radii):
    other = scene.copy()
    other[:, RADIUS] = radii
    return other


@pytest.mark.parametrize("radii", [(0.085, 0.056), (0.076, 0.064), (0.08, 0.06)])
def test_pushes_show_the_sum_of_two_radii(scene, dynamics, radii):
    """The tool moves for nominal radii, and the disks have others."""
    known = RadiusFilter(scene[:, RADIUS])
    places = make_scene(np.array([[0.4, 0.0], [0.56, 0.03]]), scene[:, 6], scene[:, RADIUS])
    for angle in (0.0, 0.2, -0.1):
        before = known.apply(places)
        push = make_push(0.2, angle, 0.15)
        predicted = dynamics.step(before[None], push[None])[0]
        way = resized_push(push, before[MID, RADIUS], radii[MID], LIMITS)
        after = dynamics.step(resized(before, radii)[None], way[None])[0]
        known.update(before, push, predicted, after, NOISE)
        known.exclude_overlaps(after, NOISE)
    assert known.radii.sum() == pytest.approx(sum(radii), abs=0.001)
    assert (known.std < 0.8 * BEFOREHAND).all()


def test_disks_nearer_than_their_radii_allow_are_smaller(scene):
    near = scene.copy()
    near[TARGET, 0] = near[MID, 0] + 0.134
    known = RadiusFilter(scene[:, RADIUS])
    known.exclude_overlaps(near, NOISE)
    assert known.radii.sum() == pytest.approx(0.134, abs=5e-4)
    known.exclude_overlaps(scene, NOISE)  # apart: tells nothing
    assert known.radii.sum() == pytest.approx(0.134, abs=5e-4)


@pytest.mark.parametrize("radius", [0.076, 0.085])
def test_an_earlier_push_keeps_its_way_when_the_radius_changes(scene, radius):
    other = resized(scene, (radius, 0.06))
    push = resized_push(PUSH, 0.08, radius, LIMITS)
    np.testing.assert_allclose(
        tool_end(other, push, LIMITS), tool_end(scene, PUSH, LIMITS), atol=1e-12
    )
    starts = tool_start(other, push, LIMITS), tool_start(scene, PUSH, LIMITS)
    across = np.array([-np.sin(0.5), np.cos(0.5)])
    assert (starts[0] - starts[1]) @ across == pytest.approx(0.0, abs=1e-12)
    known = RadiusFilter(np.array([radius, 0.06]))
    past = PushHistory.empty().then(scene, PUSH, scene, NOISE)
    told = known.restated(past, LIMITS)
    np.testing.assert_allclose(told.action[0], push)
    assert told.noise is past.noise and (told.state[0, MID, RADIUS] == radius).all()
    assert scene[MID, POSITION].tobytes() == told.state[0, MID, POSITION].tobytes()
