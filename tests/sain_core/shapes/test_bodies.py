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


@pytest.mark.parametrize(
    ("places", "error", "message"),
    [
        (
            [(0.5, 0.0), (0.55, 0.0)],
            InvalidInputError,
            r"0 \(square\) and 1 \(t\) overlap by .* mm",
        ),
        ([(0.5, 0.0)], InvalidInputError, "the scene has 1 bodies; "),
        ([(0.5, 0.0), (1.5, 0.0)], OffTableError, "disk 1 at "),
    ],
)
def test_a_scene_that_cannot_be_is_refused(places, error, message):
    with pytest.raises(error, match=message):
        check_bodies(scene(*places), Bodies.named(("square", "t")), Table())


def test_a_cube_stands_in_for_a_disk_as_long_as_the_roles_are_the_paper_s():
    assert Bodies.named(("disk", "cube", "disk:flat")).stand_in_for_disks
    assert not Bodies.named(("disk", "square")).stand_in_for_disks
    assert not Bodies.named(("disk", "cube"), ("pushable", "pushable")).stand_in_for_disks
