import sys
from importlib.metadata import EntryPoint
from types import ModuleType

import pytest

from sain_core import plugins
from sain_core.dynamics import IdentityPrior
from sain_core.errors import ConfigError


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A package that offers dynamics, and the names that it was asked for."""
    names: list[str] = []
    module = ModuleType("offering")
    module.load = lambda name: names.append(name) or IdentityPrior()  # type: ignore[attr-defined]
    module.broken = lambda name: object()  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "offering", module)
    offers = {"planar": "load", "checkpoint": "load", "broken": "broken"}
    entries = [EntryPoint(n, f"offering:{f}", plugins.GROUP) for n, f in offers.items()]
    monkeypatch.setattr(plugins, "entry_points", lambda group: entries)
    return names


def test_a_name_goes_to_its_entry_point(asked: list[str]) -> None:
    assert isinstance(plugins.load_dynamics("planar"), IdentityPrior)
    assert asked == ["planar"]


@pytest.mark.parametrize("path", ["runs/7", "model.safetensors", "~/model"])
def test_a_path_goes_to_the_checkpoint_loader(asked: list[str], path: str) -> None:
    plugins.load_dynamics(path)
    assert asked == [path]


def test_an_unknown_name_is_refused_with_the_nearest(asked: list[str]) -> None:
    message = r"model 'planer' is unknown \(did you mean 'planar'\?\); known: broken, planar"
    with pytest.raises(ConfigError, match=message):
        plugins.load_dynamics("planer")
    assert not asked


def test_what_is_no_dynamics_is_refused(asked: list[str]) -> None:
    with pytest.raises(ConfigError, match="gave a object; it must give a Dynamics"):
        plugins.load_dynamics("broken")


def test_without_any_package_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "entry_points", lambda group: [])
    with pytest.raises(ConfigError, match="none: no installed package has the entry points"):
        plugins.load_dynamics("sain")
