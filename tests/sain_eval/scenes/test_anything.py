"""Bodies of a user's file, with goals as in the trials of Push Anything."""

import json

import numpy as np
import pytest

from sain_core.errors import ConfigError, DatasetError
from sain_core.feasibility import Feasibility
from sain_core.scene import POSITION, unit
from sain_core.shapes.bodies import check_bodies
from sain_eval.scenes.placement import has_tool_room
from sain_eval.scenes.scenarios import check_scenario, draw_scene
from tests.sain_core.shapes.test_outlines import a_bar, objects

TABLE = Feasibility().table


@pytest.fixture
def file(tmp_path):
    ring = (0.05 * unit(np.linspace(0.0, 2 * np.pi, 12, endpoint=False))).tolist()
    big = (2.6 * np.array(a_bar()["outline_m"]) / 2).tolist()
    return objects(
        tmp_path,
        a_bar(mass_kg_sdf=0.05, com_uniform_density_minus_centroid_m=[0.004, 0.0]),
        a_bar(name="Can", outline_m=ring, height_m=0.12),
        a_bar(name="Plank", outline_m=big, height_m=None),
        a_bar(name="Cone", fair_2d="no"),
    )


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("letter_i", (0.50, -0.30), (0.51, 0.30)),
        ("can", (0.45, -0.25), (0.55, 0.25)),
        ("plank", (0.50, -0.15), (0.51, 0.15)),
    ],
)
def test_goals_of_one_body_are_where_the_protocol_has_them(file, name, low, high):
    cases = [draw_scene(f"anything:{name}", seed, file) for seed in range(40)]
    places = np.array([case.goal.places[0] for case in cases])
    assert (places >= low).all() and (places <= high).all()
    assert np.ptp(places[:, 1]) > 0.8 * (high[1] - low[1])
    assert len({case.goal.poses[0].heading for case in cases}) == len(cases)


def test_several_bodies_are_apart_where_they_start_and_where_they_go(file):
    for count in (2, 3, 4):
        name = "anything:" + "+".join(["letter_i", "can", "letter_i", "can"][:count])
        for seed in range(10):
            case = draw_scene(name, seed, file)
            check_bodies(case.disks, case.bodies, TABLE)
            assert len(case.goals[0].poses) == len(case.disks) == count
            for places in (case.disks[:, POSITION], case.goal.places):
                between = np.linalg.norm(places[:, None] - places, axis=-1)
                assert between[np.triu_indices(count, 1)].min() >= 0.20
                assert has_tool_room(places, case.disks[:, -1]).all()
            assert not case.goal.judge(case.disks, case.disks, case.bodies).reached


def test_bodies_have_the_masses_heights_and_centres_of_the_file(file):
    case = draw_scene("anything:letter_i+can", 3, file)
    parameters = case.parameters()
    assert parameters.heights == (0.05, 0.12) and parameters.lies_flat
    assert parameters.masses[0] == 0.05 and 0.05 < parameters.masses[1] < 1.0
    assert parameters.mass_offsets == (pytest.approx((0.004, 0.0)), (0.0, 0.0))
    assert 0.25 <= parameters.friction <= 0.45
    assert parameters.bodies.shapes[0].name.endswith(":flat")
    again = draw_scene("anything:letter_i+can", 3, file)
    assert (again.disks == case.disks).all() and again.goal == case.goal


def test_anything_alone_is_each_fair_body_in_turn(file, caplog):
    shapes = [draw_scene("anything", seed, file).shapes[0].split("-")[0] for seed in range(6)]
    assert shapes == ["letter_i", "can", "plank"] * 2
    check_scenario("anything:cone", file)
    assert "cone" in caplog.text and "no fair flat body" in caplog.text


def test_without_a_file_the_bodies_are_the_users_own(file, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with pytest.raises(ConfigError, match=r"has no bodies: give a file with --outlines, or make"):
        check_scenario("anything:mug")
    folder = tmp_path / "sain" / "shapes"
    folder.mkdir(parents=True)
    outline = {"outline": a_bar()["outline_m"], "height": 0.09}
    (folder / "mug.yaml").write_text(json.dumps({"shapes": {"mug": outline}}))
    assert draw_scene("anything:mug", 0).heights == (0.09,)


@pytest.mark.parametrize(
    ("name", "error", "text"),
    [
        ("anything:letter_l", ConfigError, r"'letter_l' is unknown \(did you mean 'letter_i'"),
        (
            "anythin",
            ConfigError,
            "'anythin' is unknown.*; anything, anything:BODY or anything:BODY",
        ),
        ("anything:plank+plank+plank+plank", ConfigError, "no room for bodies 265, .* take fewer"),
    ],
)
def test_what_cannot_be_drawn_is_said(file, name, error, text):
    with pytest.raises(error, match=text):
        check_scenario(name, file)
        draw_scene(name, 0, file)
    with pytest.raises(DatasetError, match=r"gone\.json cannot be read: No such file"):
        check_scenario("anything:can", file.with_name("gone.json"))
