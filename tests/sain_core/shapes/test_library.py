import sys
from importlib.metadata import EntryPoint
from types import ModuleType

import pytest

from sain_core.errors import ConfigError, InvalidInputError
from sain_core.guarding import plugins
from sain_core.shapes import library
from sain_core.shapes.library import GROUP, check_shapes, get_shape
from tests.hexagon import HEXAGON


@pytest.fixture
def offered(own_shapes, monkeypatch):
    """The entry points of an installed package with a shape and something else."""
    module = ModuleType("offering")
    module.HEXAGON, module.NUMBER = HEXAGON, 6  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "offering", module)
    entries: list[EntryPoint] = []
    monkeypatch.setattr(plugins, "entry_points", lambda group: entries)
    library._load_offered.cache_clear()
    return entries


def test_an_installed_package_offers_its_shapes(offered):
    offered.append(EntryPoint("six_sided", "offering:HEXAGON", GROUP))
    assert get_shape("six_sided") is HEXAGON
    message = r"shape of body 1 is 'cone' .*; allowed: disk, cube, .*six_sided"
    with pytest.raises(InvalidInputError, match=message):
        check_shapes(("disk", "cone"))


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("offering:NUMBER", "of module offering: offering:NUMBER is a int; it must be a"),
        ("offering:NONE", "cannot be loaded: AttributeError: .*; repair it"),
        ("missing_package:SHAPE", "No module named 'missing_package'; is its folder on PYTHONPATH"),
        ("offering:HEXAGON", "has the name 'six_sided'; entry point and shape must have one name"),
    ],
)
def test_an_offer_that_fails_is_named_and_disturbs_no_other(offered, target, message):
    offered.append(EntryPoint("odd", target, GROUP))
    offered.append(EntryPoint("six_sided", "offering:HEXAGON", GROUP))
    with pytest.raises(ConfigError, match=message):
        get_shape("odd")
    assert get_shape("six_sided") is HEXAGON
    assert get_shape("cube").name == "cube"  # what is built in needs no offer


def test_a_shape_of_two_packages_is_refused_and_names_both(offered):
    offered.append(EntryPoint("six_sided", "offering:HEXAGON", GROUP))
    offered.append(EntryPoint("six_sided", "other:HEXAGON", GROUP))
    message = r"offered by module offering \(offering:HEXAGON\) and module other"
    with pytest.raises(ConfigError, match=message):
        get_shape("six_sided")
