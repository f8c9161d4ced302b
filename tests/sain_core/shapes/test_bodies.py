import numpy as np
import pytest

from sain_core.errors import ConfigError, InvalidInputError, OffTableError
from sain_core.scene import Table, make_scene
from sain_core.shapes.bodies import Bodies, check_bodies


def scene(*places: tuple[float, float], radius: float = 0.08) -> np.ndarray:
    count = len(places)
    return make_scene(np.array(places), np.full(count, 8.0), np.full(count, radius))


@pytest.mark.parametrize(
    ("shapes", "roles", "message"),
    [
        ((), (), "a scene has 0 bodies; allowed: 1 to 32"),
        (("t",) * 33, (), "a scene has 33 bodies; allowed: 1 to 32"),
        (("t", "l"), ("pushable",), "2 bodies have 1 roles; give one for each"),
        (("t", "l"), ("movable", "fixed"), "no body is pushable: the roles are movable, fixed"),
        (("t", "l"), ("pushable", "stuck"), "role of body 1 is 'stuck'; allowed: pushable, "),
        (("t", "cone"), (), "shape of body 1 is 'cone' .*; allowed: disk, cube"),
    ],
)
def test_bodies_that_cannot_be_are_refused(shapes, roles, message):
    with pytest.raises(ConfigError, match=message):
        Bodies.named(shapes, roles)


def test_bodies_that_overlap_are_named_with_how_far():
    bodies = Bodies.named(("square", "t"))
    with pytest.raises(InvalidInputError) as caught:
        check_bodies(scene((0.5, 0.0), (0.55, 0.0)), bodies)
    assert "bodies 0 (square) and 1 (t) overlap by" in str(caught.value)
    assert "mm; at most 1 mm is allowed" in str(caught.value)


def test_another_number_of_bodies_and_a_body_off_the_table_are_refused():
    bodies = Bodies.named(("t", "l"))
    with pytest.raises(InvalidInputError, match="the scene has 1 bodies; "):
        check_bodies(scene((0.5, 0.0)), bodies)
    with pytest.raises(OffTableError, match="disk 1 at "):
        check_bodies(scene((0.5, 0.0), (1.5, 0.0)), bodies, Table())


def test_a_cube_stands_in_for_a_disk_as_long_as_the_roles_are_the_paper_s():
    assert Bodies.named(("disk", "cube", "disk:flat")).stand_in_for_disks
    assert not Bodies.named(("disk", "square")).stand_in_for_disks
    assert not Bodies.named(("disk", "cube"), ("pushable", "pushable")).stand_in_for_disks
