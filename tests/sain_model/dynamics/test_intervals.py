"""Regions that hold as often as they say, for errors whose law is known."""

import numpy as np
import pytest

from sain_core.scene import MASS
from sain_core.shapes.bodies import Bodies
from sain_model.data.dataset import Part
from sain_model.dynamics.intervals import FACTORS, LEVEL, Intervals, Law, Prediction, ratios
from sain_model.inference.evidence import Known
from sain_model.training.interval_fit import fit_disk, fit_law, fit_regions, with_regions
from tests.sain_model.conftest import make_part

ARM = 0.05  # [m], radius of the bodies


def draw(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Spread of members and friction, way, and errors whose scale and tails depend on them [m]."""
    random = np.random.default_rng(seed)
    parts = np.exp(random.normal([[-9.0], [-8.0], [-4.0]], 1.0, (3, count)))
    scale = 2e-5 + 2.0 * parts[0] + 0.5 * parts[1] + 0.02 * parts[2]
    tails = np.where(parts[2] > 0.02, 2.0, 8.0)  # heavy ones where much moved
    return parts, scale * np.abs(random.standard_t(tails))


def test_regions_hold_as_often_as_they_say_also_where_the_spread_is_small_or_large():
    config = fit_disk(*draw(3000, 0), np.zeros(3000), 0.9)
    parts, off = draw(20_000, 1)
    score = config.score(*parts, 0.0)
    held = off <= config.radius(score)
    assert held.mean() == pytest.approx(0.9, abs=0.015)
    for values in (score, np.hypot(parts[0], parts[1])):
        for rows in np.array_split(np.argsort(values), 3):
            assert held[rows].mean() == pytest.approx(0.9, abs=0.035)
    half = fit_disk(*draw(3000, 0), np.zeros(3000), 0.5)
    assert (off <= half.radius(half.score(*parts, 0.0))).mean() == pytest.approx(0.5, abs=0.02)


def push_bodies(
    random: np.random.Generator, bodies: int, surfaces: int, pushes: int
) -> tuple[Prediction, Part]:
    """Predict pushes whose errors differ by body and by surface, with heavy tails.

    They grow with the way, for places and headings by factors of their own.
    """
    pairs = bodies * surfaces
    of_body, of_surface = (np.exp(random.normal(0.0, 0.3, (n, 2))) for n in (bodies, surfaces))
    factors = (of_body[:, None] * of_surface).reshape(pairs, 2).repeat(pushes, axis=0)
    way = random.uniform(0.0, 0.05, len(factors))
    sizes = (2e-4 + 0.05 * way)[:, None] * factors
    errors = random.standard_t(3.0, (len(way), 3)) * sizes[:, [0, 0, 1]]
    before = np.zeros((len(way), 1, 8))
    before[..., MASS:] = 0.2, ARM
    mean = before.copy()
    mean[:, 0, 0] = way
    after = mean.copy()
    after[:, 0, :3] += errors / (1.0, 1.0, ARM)
    episode, step = np.repeat(np.arange(pairs), pushes), np.tile(np.arange(pushes), pairs)
    shape = Bodies.named(["box_3x2"])
    part = make_part(before, np.zeros((len(way), 5)), after, episode, bodies=shape, step=step)
    nothing = np.zeros((len(way), 1))
    return Prediction(mean, nothing, nothing), part


@pytest.mark.parametrize("own", [0, 20, 100])
def test_regions_of_new_bodies_on_new_surfaces_hold_as_often_as_they_say(own):
    """In all, and, after own pushes, of each body within what chance explains."""
    random = np.random.default_rng(1)
    predicted, part = push_bodies(random, 12, 3, 60)
    intervals = fit_regions([predicted], [part], Known.earlier(part.episode, part.step))
    held, pushes = [], 300
    for _ in range(40):  # each body on a surface of its own
        new, part = push_bodies(random, 1, 1, own + pushes)
        about = with_regions(intervals, new, part)
        total = intervals.curves(about, part)[:own].sum(axis=0, keepdims=True)
        about = about.widened(np.repeat(intervals.widening(total, np.array([own])), len(part), 1))
        held.append([(ratio[own:] <= 1.0).mean() for ratio in ratios(about, part)])
    # before any push, what 36 bodies show of how far bodies differ is uncertain
    assert (np.abs(np.mean(held, axis=0) - LEVEL) < (0.03 if own else 0.06)).all()
    if own == 100:
        assert (np.abs(np.array(held) - LEVEL) < 4.0 * np.sqrt(LEVEL * (1 - LEVEL) / own)).all()


def test_a_world_that_is_harder_than_the_others_has_its_share_before_any_push():
    random = np.random.default_rng(2)
    errors = np.abs(random.standard_normal(4000)) * np.repeat([1.0, 3.0], [3000, 1000])
    worlds, nothing = np.repeat(["easy", "hard"], [3000, 1000]), Known.first(4000, [0] * 4000)
    law = fit_law(errors, nothing, worlds, LEVEL)
    factor = law.quantile(np.zeros((1, len(FACTORS))), np.array([0]))[0]
    assert (errors[3000:] <= factor).mean() == pytest.approx(LEVEL, abs=0.02)


def test_outliers_widen_regions_little_and_large_errors_much():
    law = Law(size=0.5, dimensions=2.0, tail=4.0, bodies=0.3)

    def factor(*ratio: float) -> float:
        total = law.curves(np.array(ratio)).sum(axis=0, keepdims=True)
        return float(law.quantile(total, np.array([len(ratio)]))[0])

    usual = factor(*[0.4] * 9)
    assert factor(*[0.4] * 8, 100.0) < 1.7 * usual
    assert factor(*[4.0] * 9) > 7.0 * usual
    assert factor(*[0.04] * 9) < 0.5 * usual
    assert (
        Intervals().places.quantile(np.zeros((3, len(FACTORS))), np.arange(3)).tolist() == [1.0] * 3
    )


def test_headings_have_regions_of_the_same_kind():
    random = np.random.default_rng(3)
    scenes = np.zeros((3000, 1, 8))
    scenes[..., 6:] = 0.2, 0.05  # mass and radius
    pushes = np.zeros((3000, 5))
    after = scenes.copy()
    after[:, 0, 0] += 0.02 + random.normal(0.0, 1e-3, 3000)
    after[:, 0, 2] += random.normal(0.0, 0.04, 3000)
    mean = scenes.copy()
    mean[:, 0, 0] += 0.02
    nothing = np.zeros((3000, 1))
    predicted = Prediction(mean, nothing, nothing)
    episode = np.arange(3000)
    bodies = Bodies.named(["box_3x2"])
    part = make_part(scenes, pushes, after, episode, bodies=bodies)
    about = with_regions(
        fit_regions([predicted], [part], Known.first(3000, [0] * 3000)), predicted, part
    )
    held = np.abs(after[:, 0, 2]) <= about.turn[:, 0]
    assert held.mean() == pytest.approx(0.9, abs=0.02)
    assert about.turn[0, 0] == pytest.approx(1.64 * 0.04, rel=0.15)
    wider = about.widened(np.full((2, 3000), 2.0))
    np.testing.assert_allclose(wider.turn, 2.0 * about.turn)
