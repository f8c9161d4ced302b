"""The protocol of Push Anything: bodies with tags, its goals, and the page of times."""

from itertools import islice

import numpy as np
import pytest
from shapely import Polygon, union_all

from benchmarks.anything.__main__ import goals, read_results, read_times, rows_of
from benchmarks.anything.bodies import MOST_TAGS, PAPER, place_tags
from benchmarks.anything.page import page
from benchmarks.anything.replanning import HiddenPhysics
from sain_core.errors import DatasetError
from sain_core.output import write_json
from sain_core.push import make_push
from sain_core.scene import unit
from sain_core.shapes.body_file import Tag, parse_bodies
from sain_core.shapes.library import own_bodies
from sain_eval.scenes.anything import AnythingScenario
from sain_model.physics.planar import PlanarPrior

BLOCK = [[-0.06, -0.04], [0.06, -0.04], [0.06, 0.04], [-0.06, 0.04]]
OBJECTS = {"Block": (BLOCK, 0.05), "Bar": ([[2 * x, y / 3] for x, y in BLOCK], 0.03)}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "objects.json"
    rows = [{"name": n, "outline_m": o, "height_m": h} for n, (o, h) in OBJECTS.items()]
    write_json(path, {"objects": rows})
    return path


@pytest.mark.parametrize(
    "outline",
    [
        np.array(BLOCK),
        0.08 * unit(np.linspace(0, 2 * np.pi, 30)[:-1]),
        np.array([(0, 0), (0.12, 0), (0.12, 0.03), (0.03, 0.03), (0.03, 0.12), (0, 0.12)]),
    ],
)
def test_tags_lie_on_their_body_with_their_paper_and_apart(outline):
    tags = [Tag(one.pop("id"), **one) for one in place_tags(outline, 6)]
    assert [tag.number for tag in tags] == list(range(6, 6 + MOST_TAGS))
    papers = [Polygon(Tag(0, PAPER * tag.size, tag.x, tag.y, tag.angle).corners()) for tag in tags]
    assert Polygon(outline).buffer(1e-4).covers(union_all(papers))
    assert union_all(papers).area == pytest.approx(sum(one.area for one in papers), rel=1e-3)


def test_a_body_without_room_has_no_tags():
    assert place_tags(0.01 * np.array(BLOCK) / 0.06, 0) == []


def test_a_bodies_file_is_that_of_the_outlines(file):
    content = {"bodies": rows_of(file, ["block", "bar"], own_bodies(file), "tags")}
    bodies = parse_bodies(content)
    assert bodies.names == ("block", "bar") and bodies.heights == (0.05, 0.03)
    assert not bodies.weighed and all(len(tags) == MOST_TAGS for tags in bodies.tags)
    assert bodies.bodies.lie_flat and len(bodies.bodies.pushable) == 2


def test_goals_are_where_the_robot_reaches_and_the_same_for_each_run(file):
    some, again = (list(islice(goals("block+bar", file, "ur5", 3), 6)) for _ in range(2))
    assert some == again
    for goal in some:
        first, second = goal.places
        assert np.hypot(*(first - second)) >= 0.2
        assert {pose.tolerance for pose in goal.poses} == {0.02}
        assert {round(pose.heading_tolerance, 9) for pose in goal.poses} == {0.1}


def played(seconds, failure="", commit="0123456789ab"):
    made = {"commit": commit, "processor": "a CPU", "seed": 0}
    return {"seconds": seconds, "at_rest": 0.25, "busy": 0.5, "failure": failure} | made


def test_the_page_has_our_times_beside_those_of_others(tmp_path):
    times = tmp_path / "times.json"
    write_json(times, {"objects": {"Block": {"times": [10.0, 20.0, 60.0]}}})
    found = {
        "trials": {
            "ur5 tags block": {
                "goals": [
                    played(4.0, commit="fedcba987-dirty"),
                    played(6.0),
                    played(None, "120 s are over"),
                ],
                "broken": ["limits {}, contacts {}, tool 3"],
            },
            "ur5 tags jug": {"goals": [played(9.0)], "broken": ["limits {}, contacts {}, tool 3"]},
            "ur5 tags block+jug": {"goals": [played(30.0)], "broken": []},
        },
        "theirs": read_times(times),
        "flat": {"block": "yes", "jug": "no"},
    }
    text = page(found)
    assert (
        "| block | 2/3 | 5.0 | 20.0 | 0.25 | 5.0 | 30.0 | 5.8 | 52.0 | 6.0 | 60.0 | yes |" in text
    )
    assert "| jug | 1/1 | 9.0 | - | - | 9.0 | - | 9.0 | - | 9.0 | - | no |" in text
    assert "## ur5, seen by tags, several bodies at once" in text
    assert "| block+jug | 1/1 | 30.0 | - | - | 30.0 | 96 | 30.0 |" in text
    assert "limit, and no part of the arm but the tool touched anything." in text
    assert (
        "2 of 3 goals were reached (66.7%), median 5.0 s, worst 6.0 s." in text
        and "block: 120 s are over" in text
    )
    assert "| 1 | 0 | fedcba987-dirty | a CPU |" in text
    assert "| 4 | 0 | 0123456789ab | a CPU |" in text
    assert read_times(tmp_path / "none.json") == {}


def test_the_page_states_what_the_arm_broke_and_goals_of_which_none_is_reached():
    failed, broken = played(None, "120 s are over"), "limits {'elbow': 2}, contacts {}, tool 3"
    trials = {
        "ur5 tags mug": {"goals": [failed], "broken": [broken, "limits {}, contacts {}, tool 0"]}
    }
    text = page({"trials": trials, "theirs": {}, "flat": {"mug": ""}})
    assert (
        "Exceeded limits, and contacts that must not be: limits {'elbow': 2}, contacts {}." in text
    )
    assert "0 of 1 goals were reached (0.0%). No joint" in text
    assert "| mug | 0/1 | - | - | - |" in text


def test_results_without_commits_are_refused(tmp_path):
    path, goal = tmp_path / "results.json", played(4.0)
    assert read_results(path) == {}
    found = {"trials": {"ur5 tags mug": {"goals": [goal], "broken": []}}}
    assert read_results(write_json(path, found)) == found
    del goal["commit"]
    with pytest.raises(
        DatasetError, match=r"goals of ur5 tags mug without a commit.*another --out"
    ):
        read_results(write_json(path, found))


def test_a_stroke_that_is_corrected_leads_nearer_to_what_was_planned(file):
    apart = {False: 0.0, True: 0.0}
    for seed in range(4):
        case = AnythingScenario.named("anything:block", file).scene(seed)
        push = make_push(0.9, 0.2, 0.12)
        planned = PlanarPrior(bodies=case.bodies).step(case.disks[None], push[None])[0]
        for corrects in apart:
            after = HiddenPhysics(case, corrects).push(push).after
            apart[corrects] += float(np.hypot(*(after - planned)[0, :2]))
    assert apart[True] < 0.7 * apart[False]
