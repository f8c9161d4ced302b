"""Every scene that a scenario draws can be solved, and comes from its seed alone."""

import hashlib

import numpy as np
import pytest

from sain_core.feasibility import Feasibility, reachable
from sain_core.push import make_push
from sain_core.scene import MID, POSITION, RADIUS, TARGET, surface_gaps
from sain_core.shapes.bodies import check_bodies
from sain_eval.scenes.families import CONTACT_GAP
from sain_eval.scenes.scenarios import SCENARIOS
from sain_sim.world.truth import TruthConfig

FEASIBILITY = Feasibility()
SEEDS = range(60)
PAPER = ("paper", "paper_shift", "paper_cube")
ANYWHERE = ("anywhere", "clutter", "anywhere_cube", "anywhere_rubber")
LOCATIONS = np.linspace(-np.pi, np.pi, 73)[1:]


PUBLISHED = {
    "paper": "d88d032b1738",
    "paper_shift": "11d76097ee54",
    "paper_cube": "a4f105331c23",
    "anywhere": "27d291a8c84b",
    "clutter": "f5ee8fd0d1d1",
    "anywhere_cube": "2457c877134f",
    "anywhere_rubber": "842bea557f25",
    "box": "58726d17b9df",
    "push_t": "dcaf9d41ae81",
    "shapes": "014dd587c1ea",
    "shapes_indirect": "d9d12129bb7a",
    "rearrange_2": "d7cf7a36bf0a",
    "rearrange_3": "30aacac45cbe",
    "rearrange_4": "e70c04942e0a",
    "blocked": "af61050694d8",
    "streak": "03a45db2ee61",
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_first_scenes_are_those_that_were_published(name):
    digest = hashlib.sha256()
    for seed in range(3):
        case = SCENARIOS[name].scene(seed)
        goals = [goal.numbers for goal in case.goals]
        numbers = np.concatenate([case.disks.ravel(), *goals, [case.friction]])
        digest.update((np.round(numbers, 9) + 0.0).tobytes())  # without the last bits and -0
        digest.update(" ".join(case.shapes).encode())
    assert digest.hexdigest()[:12] == PUBLISHED[name]


@pytest.fixture(params=sorted((*PAPER, *ANYWHERE)))
def scenario(request):
    return SCENARIOS[request.param]


def test_scenes_exist_and_their_goal_is_on_the_table(scenario):
    for seed in SEEDS:
        case = scenario.scene(seed)
        check_bodies(case.disks, table=FEASIBILITY.table)
        assert FEASIBILITY.table.contains(case.goal.places[0])
        assert len(case.shapes) == len(case.disks)
        assert case.max_pushes == 15
        gap = surface_gaps(case.disks)[MID, TARGET]
        assert gap == pytest.approx(CONTACT_GAP, abs=1e-12)


def test_the_mid_disk_can_be_approached(scenario):
    pushes = make_push(LOCATIONS, 0.0, 0.03)
    for seed in SEEDS:
        disks = scenario.scene(seed).disks
        assert FEASIBILITY.mask(np.broadcast_to(disks, (72, *disks.shape)), pushes).sum() >= 12


def test_parameters_are_in_the_papers_ranges(scenario):
    cases = [scenario.scene(seed) for seed in SEEDS]
    friction = np.array([case.friction for case in cases])
    mid = np.array([case.disks[MID, RADIUS] for case in cases])
    low, high = (0.25, 0.45) if scenario.name == "anywhere_rubber" else (0.08, 0.20)
    assert friction.min() >= low and friction.max() <= high
    assert np.ptp(friction) > 0.65 * (high - low)
    assert mid.min() >= 0.075 and mid.max() <= 0.085 and np.ptp(mid) > 0.006


@pytest.mark.parametrize("name", ANYWHERE)
def test_a_straight_push_from_behind_reaches_the_goal(name):
    for seed in SEEDS:
        case = SCENARIOS[name].scene(seed)
        pair = case.disks[:2].copy()
        way = case.goal.places[0] - pair[TARGET, POSITION]
        length = np.linalg.norm(way)
        assert 0.15 <= length <= 0.30
        pair[MID, POSITION] = pair[TARGET, POSITION] - way / length * pair[:, RADIUS].sum()
        push = make_push(np.arctan2(way[1], way[0]), 0.0, length)
        assert reachable(pair, push, FEASIBILITY.limits, FEASIBILITY.reach)


def test_the_paper_scene_is_the_papers():
    case = SCENARIOS["paper"].scene(0)
    np.testing.assert_array_equal(case.disks[MID, POSITION], [0.35, 0.0])
    np.testing.assert_array_equal(case.goal.places, [[0.80, 0.0]])
    shifted = SCENARIOS["paper_shift"].scene(0)
    np.testing.assert_allclose(np.abs(shifted.goal.places[0] - [0.80, 0.0]), 0.02)
    assert SCENARIOS["paper_cube"].scene(0).shapes == ("disk", "cube")


def test_a_scene_can_be_played_in_a_rough_world():
    case = SCENARIOS["clutter"].scene(3)
    rough = case.within(TruthConfig("rough", lab=2))
    assert np.array_equal(rough.disks, case.disks) and rough.goal is case.goal
    parameters = rough.parameters()
    assert len(parameters.roughness.mass_offsets) == len(case.disks)
    assert parameters.friction == rough.friction != case.friction  # what the oracle is told
    same = case.within(TruthConfig())
    assert same.parameters() == case.parameters() and same.friction == case.friction
