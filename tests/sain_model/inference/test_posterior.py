"""Earlier pushes show the physics with its parameters, masses, and whether a network holds."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from sain_core.push import make_push
from sain_core.scene import MASS, POSITION, THETA, make_scene
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.sain import residual_model
from sain_model.inference import posterior as inference
from sain_model.inference.episodes import Episodes
from sain_model.inference.evidence import Known, ObservedPushes
from sain_model.inference.kinds import (
    FRICTION,
    MASS_RATIO,
    Belief,
    default_belief,
    friction_kind,
    read_belief,
    write_belief,
)
from sain_model.inference.posterior import Posterior, Trace, infer, traces
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.parameters import AXES, TEXTBOOK, PlanarConfig, with_mass_ratio
from sain_model.physics.planar import PlanarPrior
from tests.sain_model.conftest import random_network

Draw = Callable[[int, int], tuple[Scenes, Pushes]]
AXES_FIRST, TEXTBOOK_SECOND = range(2)
COUNT = 6


@pytest.fixture
def belief():
    return default_belief(PlanarPrior(AXES))


@pytest.fixture
def sain(belief):
    torch.manual_seed(0)
    model = residual_model(
        InteractionNetwork().weights, friction_kind(PlanarPrior(AXES)), "planar_axes"
    )
    return model.believing(belief)


def seen(draw: Draw, config: PlanarConfig, count: int = COUNT, seed: int = 5) -> PushHistory:
    """Return what a world of this physics shows, with errors of 0.1 mm."""
    scenes, pushes = draw(count, seed)
    after = PlanarPrior(config).step(scenes, pushes)
    after[..., :2] += np.random.default_rng(seed).normal(0, 1e-4, after[..., :2].shape)
    return PushHistory(scenes, pushes, after)


def observed(history: PushHistory) -> ObservedPushes:
    arrays = history.state, history.action, history.next_state
    return ObservedPushes(*arrays, np.zeros(len(history), np.int64))


def joined(*some: PushHistory) -> PushHistory:
    return PushHistory(
        *(np.concatenate([getattr(one, name) for one in some]) for name in some[0].arrays)
    )


def after(belief: Belief, history: PushHistory) -> Posterior:
    return infer(belief, observed(history), Known.first(len(history), [len(history)]))


@pytest.mark.parametrize(("config", "kind"), [(AXES, AXES_FIRST), (TEXTBOOK, TEXTBOOK_SECOND)])
def test_pushes_show_the_kind_of_physics_and_its_friction(belief, random_pushes, config, kind):
    posterior = after(belief, seen(random_pushes, replace(config, friction=0.17)))
    assert posterior.kind.tolist() == [kind]
    assert not posterior.inferred[0]
    assert posterior.values(FRICTION)[0] == pytest.approx(0.17, rel=0.03)
    assert posterior.log_spread(FRICTION)[0] < 0.05


def test_pushes_show_parameters_that_are_unlike_the_default_ones(belief, random_pushes):
    truth = replace(TEXTBOOK, friction=0.2, tool_friction=0.3, disk_friction=0.05)
    posterior = after(belief, seen(random_pushes, truth, count=10))
    assert posterior.kind[0] == TEXTBOOK_SECOND
    assert posterior.inferred[0]
    kind = belief.kinds[TEXTBOOK_SECOND]
    found = kind.values(posterior.places)
    for column, parameter in enumerate(kind.parameters[:3]):
        off = np.log(found[parameter.name][0] / getattr(truth, parameter.name))
        spread = parameter.spread * posterior.spreads[0, column]
        assert abs(off) < 4 * spread + 0.05, parameter.name


def test_a_history_and_a_row_of_many_say_the_same(sain, random_pushes):
    history = seen(random_pushes, replace(TEXTBOOK, friction=0.09))
    order = np.zeros(COUNT, np.int64), np.arange(COUNT)
    inferred = sain.infer(observed(history), Known.earlier(*order))
    rows = sain.predict_rows(history.state, history.action, inferred)
    for push in range(COUNT):
        informed = sain.condition(history.select(slice(push)))
        one = informed.step(history.state[push : push + 1], history.action[push : push + 1])
        np.testing.assert_allclose(one[0], rows.mean[push], atol=1e-9)


def test_a_correction_that_pushes_contradict_is_dropped(belief, random_pushes):
    weights = random_network(0.3).weights
    wild = residual_model(weights, friction_kind(PlanarPrior(AXES)), "planar_axes")
    wild = wild.believing(belief)
    informed = wild.condition(seen(random_pushes, AXES))
    assert wild.corrects
    assert not informed.corrects
    scenes, pushes = random_pushes(3, 9)
    physics = informed.physics.step(scenes, pushes)
    np.testing.assert_array_equal(informed.step(scenes, pushes), physics)
    rollout = informed.rollout(scenes[0], pushes[None])
    np.testing.assert_array_equal(rollout[0, 0], informed.step(scenes[:1], pushes[:1])[0])


RATIO = 1.6


def telling(draw: Draw, count: int = 4, noise: float | None = None) -> PushHistory:
    """Return pushes that move the target in a world whose masses are not as scenes state.

    They are seen with errors of 0.1 mm, or with a noise [m].
    """
    scenes, pushes = draw(200, 7)
    scenes[..., MASS] = 8.0
    after = PlanarPrior(AXES).step(with_mass_ratio(scenes, RATIO), pushes)
    after[..., MASS] = 8.0
    moved = np.linalg.norm((after - scenes)[:, 1, POSITION], axis=-1) > 0.01
    chosen = np.flatnonzero(moved)[:count]
    assert len(chosen) == count
    error = np.random.default_rng(3).normal(0, noise or 1e-4, after[..., POSITION].shape)
    after[..., POSITION] += error
    seen = None if noise is None else np.full((count, 2), noise)
    return PushHistory(scenes[chosen], pushes[chosen], after[chosen], seen)


@pytest.mark.parametrize("noise", [None, 0.001])
def test_predictions_rest_on_the_ratio_of_masses(sain, random_pushes, noise):
    history = telling(random_pushes, noise=noise)
    usual, unknown = sain.condition(history), sain.with_unknown_masses()
    told = unknown.condition(history)
    assert unknown.spread(MASS_RATIO) == pytest.approx(0.3, rel=0.05)
    assert 0.0 < told.spread(MASS_RATIO) < 0.15
    off = abs(np.log(told.value(MASS_RATIO) / RATIO))
    assert off < 2.0 * told.spread(MASS_RATIO)

    later = telling(random_pushes, count=12).select(slice(4, None))
    errors = [
        np.linalg.norm((m.step(later.state, later.action) - later.next_state)[:, 1, :2], axis=-1)
        for m in (told, usual)
    ]
    assert errors[0].mean() < 0.5 * errors[1].mean()


@pytest.mark.parametrize("unknown", [False, True])
def test_a_belief_is_read_as_it_was_written(belief, tmp_path, unknown):
    written = belief.with_unknown_masses() if unknown else belief
    read = read_belief(write_belief(tmp_path / "belief.json", written))
    for kind, other in zip(read.kinds, written.kinds, strict=True):
        assert (kind.name, kind.names, kind.prior) == (other.name, other.names, other.prior)
        np.testing.assert_array_equal(kind.covariance, other.covariance)
    assert (MASS_RATIO in read.likeliest.names) == unknown


def test_a_table_that_changes_in_mid_episode_is_found_again(belief, random_pushes):
    then = replace(TEXTBOOK, friction=0.2, tool_friction=0.3, disk_friction=0.05)
    now = replace(AXES, friction=0.07, tool_friction=0.05)
    test, off = seen(random_pushes, now, 40, 991), []
    for seed in (3, 13):
        earlier, later = seen(random_pushes, then, 5, seed), seen(random_pushes, now, 15, seed + 1)
        found = after(belief, joined(earlier, later))
        predicted = found.of_rows(np.zeros(40, np.int64)).step(
            observed(test).bodies, test.state, test.action
        )
        error = np.linalg.norm((predicted - test.next_state)[..., POSITION], axis=-1)
        off.append(error.max(axis=1).mean())
    assert np.mean(off) < 0.002


def test_a_long_history_takes_few_steps_and_the_same_ones_as_one_push_after_the_other(
    random_pushes, monkeypatch
):
    history, kind = observed(seen(random_pushes, TEXTBOOK, 60)), friction_kind(PlanarPrior())
    steps, then = [], Trace.then
    monkeypatch.setattr(Trace, "then", lambda *known: steps.append(0) or then(*known))
    inference._place_of.cache_clear()
    (cold,) = traces(kind, history, Known.first(60, [60]))
    assert len(steps) < 45
    inference._place_of.cache_clear()
    for count in (59, 60):
        some = history.select(slice(count))
        (warm,) = traces(kind, some, Known.first(count, [count]))
    assert warm.place.tobytes() == cold.place.tobytes()


def test_the_parts_of_an_episode_are_kept_so_that_each_push_is_one_step(random_pushes, monkeypatch):
    """Each push is predicted from those before it, for the regions: all parts, after each push."""
    history, kind = observed(seen(random_pushes, TEXTBOOK, 12)), friction_kind(PlanarPrior())
    steps, then = [], Trace.then
    monkeypatch.setattr(Trace, "then", lambda *known: steps.append(0) or then(*known))
    inference._place_of.cache_clear()
    for count in range(1, 13):
        some, parts = history.select(slice(count)), list(range(1, count + 1))
        warm = traces(kind, some, Known.first(count, parts))
    assert len(steps) == 12
    inference._place_of.cache_clear()
    cold = traces(kind, history, Known.first(12, list(range(1, 13))))
    for one, other in zip(warm, cold, strict=True):
        assert one.place.tobytes() == other.place.tobytes()


def test_values_that_are_given_are_told_apart_by_their_names(belief, random_pushes):
    history, kind = observed(seen(random_pushes, TEXTBOOK, 3)), belief.kinds[TEXTBOOK_SECOND]
    places = []
    for name in ("friction", "tool_friction"):
        known = replace(history, given={name: np.full(3, 0.2)})
        places.append(traces(kind, known, Known.first(3, [3]))[0].place)
    assert not np.array_equal(*places)


CENTRES = np.array([(0.15, -0.05), (-0.1, 0.12)])  # of mass, of two disks


def pushed_disks(count: int, seed: int = 8, centres: np.ndarray = CENTRES) -> PushHistory:
    """Return pushes of one disk and the other in turn, neither of which hits the other."""
    random = np.random.default_rng(seed)
    places = np.array([(0.4, -0.2), (0.6, 0.2)])
    scenes = np.repeat(make_scene(places, np.full(2, 8.0), np.full(2, 0.07))[None], count, axis=0)
    scenes[..., THETA] = random.uniform(-np.pi, np.pi, (count, 2))
    pushes = np.stack(
        [
            make_push(random.uniform(-np.pi, np.pi), random.uniform(-0.5, 0.5), 0.08, body=push % 2)
            for push in range(count)
        ]
    )
    each = tuple(replace(TEXTBOOK, centre_x=x, centre_y=y) for x, y in centres)
    after = PlanarPrior(TEXTBOOK, each=each).step(scenes, pushes)
    after[..., POSITION] += random.normal(0, 1e-4, after[..., POSITION].shape)
    return PushHistory(scenes, pushes, after)


def test_each_disk_of_a_scene_has_its_own_centre_of_mass(sain):
    history, errors = pushed_disks(14), list[float]()
    for push in (0, 4, 8, 12):
        informed = sain.condition(history.select(slice(push)))
        rows = slice(push, push + 2)  # one of each disk
        off = informed.step(history.state[rows], history.action[rows]) - history.next_state[rows]
        errors.append(float(np.linalg.norm(off[..., POSITION], axis=-1).max()))
    first, *_, last = errors
    assert last < 0.25 * first
    found = np.column_stack([informed.now.values(name)[0] for name in ("centre_x", "centre_y")])
    np.testing.assert_allclose(found, CENTRES, atol=0.04)


def test_a_disk_that_no_push_moves_is_like_the_other_as_far_as_bodies_are_alike(belief):
    history = pushed_disks(12).select(np.arange(0, 12, 2))  # of body 0
    kind = belief.kinds[TEXTBOOK_SECOND].of_scene(2)
    (found,) = traces(kind, observed(history), Known.first(6, [6]))
    columns = np.flatnonzero(np.equal(kind.body, 1))
    same = [kind.names.index(kind.names[column]) for column in columns]
    assert not found.slopes[..., columns].any()
    before, shared = kind.covariance[columns, columns], kind.covariance[columns, same]
    place = shared / before * found.place[same]
    np.testing.assert_allclose(found.place[columns], place, atol=1e-3)
    assert (found.covariance[columns, columns] > before - shared).all()


def test_episodes_show_how_far_the_bodies_of_a_laboratory_differ(belief):
    kind, random = belief.kinds[TEXTBOOK_SECOND], np.random.default_rng(2)
    centres = random.uniform(-0.2, 0.2, (5, 2, 2))
    some = [pushed_disks(8, seed, each) for seed, each in enumerate(centres)]
    pushes = replace(observed(joined(*some)), episode=np.repeat(np.arange(5), 8))
    found = Episodes.before(kind)
    for _ in range(4):
        found = found.learn([pushes], list("abcde"), 10)
    columns = [kind.names.index("centre_x"), kind.names.index("centre_y")]
    z = found.places.reshape(5, -1)
    names = found.next.of_scene(2).names
    seen = [np.flatnonzero(np.equal(names, name)) for name in ("centre_x", "centre_y")]
    values = 0.05 * np.stack([z[:, some] for some in seen], axis=-1)  # (5, 2, 2)
    np.testing.assert_allclose(values, centres, atol=0.04)
    spread = 0.05 * np.sqrt(found.own[columns])
    assert (spread > 0.5 * centres.std(axis=(0, 1))).all()
    np.testing.assert_allclose(0.05 * found.mean[columns], 0.0, atol=0.1)
