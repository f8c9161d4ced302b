"""What the laboratory refuses before it starts anything."""

import pytest
import yaml
from rich.console import Console

from sain_arm.robot.robot import SHIPPED
from sain_bringup.laboratory import LaboratoryOptions, run
from sain_core.errors import ConfigError

LARGE = SHIPPED / "bodies" / "t.yaml"


def test_a_body_too_large_for_the_robot_s_reach_is_named_with_both_sizes():
    with pytest.raises(ConfigError) as refused:
        run(LaboratoryOptions(robot="so101", bodies=LARGE), Console())
    assert str(refused.value).startswith(
        "body 0 (T) is too large, with a radius of 0.09 m: the tool of robot 'so101' must stand"
        " 0.103 m from the body's middle on all sides; the largest circle in its reach has a"
    )


def test_a_small_robot_has_a_small_t_where_it_can_push_it():
    options = LaboratoryOptions(robot="so101")
    assert options.bodies_file.name == "so101.yaml"
    x, y, _ = options.place
    assert 0.35 < x < 0.5 and abs(y) < 0.15
    assert LaboratoryOptions(robot="ur5").bodies_file == LARGE
    assert LaboratoryOptions(robot="ur5").place == ()


def test_tags_too_small_for_the_camera_are_named_with_their_pixels(tmp_path):
    content = yaml.safe_load(LARGE.read_text())
    content["bodies"][0]["tags"][1]["size"] = 0.01
    path = tmp_path / "small.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError) as refused:
        run(LaboratoryOptions(robot="ur5", bodies=path, see="tags"), Console())
    text = "tag 1 of body 0 (T) is too small for the camera: with its side of 10 mm it is 8"
    assert str(refused.value).startswith(text)
    assert "px wide, and 10 px are needed; give --bodies with larger tags" in str(refused.value)
