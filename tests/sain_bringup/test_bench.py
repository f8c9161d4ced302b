"""What a bench refuses before it starts anything."""

import pytest
import yaml

from sain_arm.robot.robot import SHIPPED
from sain_bringup.graph import GraphOptions
from sain_bringup.reach import check_reach
from sain_core.errors import ConfigError
from sain_eval.scenes.scenarios import draw_scene

LARGE = SHIPPED / "bodies" / "t.yaml"


def bench(robot, **given):
    found = GraphOptions(robot=robot, faults="none", **given).bench
    assert found is not None
    return found


def test_a_body_too_large_for_the_robot_s_reach_is_named_with_both_sizes():
    with pytest.raises(ConfigError) as refused:
        bench("so101", bodies=LARGE).check()
    assert str(refused.value).startswith(
        "body 0 (T) is too large, with a radius of 0.09 m: the tool of robot 'so101' must stand"
        " 0.103 m from the body's middle on all sides; the largest circle in its reach has a"
    )


def test_a_small_robot_has_a_small_t_where_it_can_push_it():
    small = bench("so101")
    assert small.bodies_file.name == "so101.yaml"
    x, y, _ = small.place
    assert 0.35 < x < 0.5 and abs(y) < 0.15
    large = bench("ur5")
    assert large.bodies_file == LARGE
    assert large.place == pytest.approx((0.5, 0.0, 0.0), abs=0.1)


def test_tags_too_small_for_the_camera_are_named_with_their_pixels(tmp_path):
    content = yaml.safe_load(LARGE.read_text())
    content["bodies"][0]["tags"][1]["size"] = 0.01
    path = tmp_path / "small.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError) as refused:
        bench("ur5", bodies=path, see="tags").check()
    text = "tag 1 of body 0 (T) is too small for the camera: with its side of 10 mm it is 7."
    assert str(refused.value).startswith(text)
    assert "px wide, and 10 px are needed; give --bodies with larger tags" in str(refused.value)


def test_a_robot_without_enough_reach_for_a_scenario_is_named_with_its_share_of_the_table():
    cases = [draw_scene("push_t", seed) for seed in range(3)]
    check_reach("ur5", cases)
    with pytest.raises(ConfigError) as refused:
        check_reach("so101", cases)
    text = str(refused.value)
    assert text.startswith("robot 'so101' reaches 6% of the table, within x 0.30 to 0.53 m")
    assert "body 0 is at (" in text and "m in push_t, seed " in text
    with pytest.raises(ConfigError, match=r"the tool that pushes body 1 by body 0 is at \(0\.\d"):
        check_reach("so101", [draw_scene("anywhere", 0)])
