import sys
from importlib.metadata import EntryPoint
from types import ModuleType

import pytest

from sain_core import model
from sain_core.errors import ConfigError
from sain_core.guarding import plugins
from sain_core.model import IdentityPrior


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A package that offers dynamics, and the names that it was asked for."""
    names: list[str] = []
    module = ModuleType("offering")
    module.load = lambda name: names.append(name) or IdentityPrior()  # type: ignore[attr-defined]
    module.broken = lambda name: object()  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "offering", module)
    offered = {"planar": "load", "checkpoint": "load", "broken": "broken"}
    entries = [EntryPoint(n, f"offering:{f}", model.GROUP) for n, f in offered.items()]
    monkeypatch.setattr(plugins, "entry_points", lambda group: entries)
    return names


def test_a_name_goes_to_its_entry_point(asked: list[str]) -> None:
    assert isinstance(model.load_dynamics("planar"), IdentityPrior)
    assert asked == ["planar"]


@pytest.mark.parametrize("path", ["runs/7", "model.safetensors", "~/model"])
def test_a_path_goes_to_the_checkpoint_loader(asked: list[str], path: str) -> None:
    model.load_dynamics(path)
    assert asked == [path]


def test_an_unknown_name_is_refused_with_the_nearest(asked: list[str]) -> None:
    message = r"model 'planer' is unknown \(did you mean 'planar'\?\); known: broken, planar"
    with pytest.raises(ConfigError, match=message):
        model.load_dynamics("planer")
    assert not asked


def test_what_is_no_dynamics_is_refused(asked: list[str]) -> None:
    message = (
        "model 'broken' of the package of offering: offering:broken returned a object has no method"
        r" step\(scenes, pushes\); a model inherits from sain_core.model.Model"
    )
    with pytest.raises(ConfigError, match=message):
        model.load_dynamics("broken")


class Weighing(IdentityPrior):
    def with_unknown_masses(self) -> "Weighed":
        return Weighed()


class Weighed(IdentityPrior):
    pass


def test_a_dynamics_infers_masses_that_are_not_measured_if_it_can() -> None:
    for unknown in ("mass", "radius, mass"):
        assert isinstance(model.as_observed(Weighing(), unknown), Weighed)
    for unknown in ("", "radius"):
        assert isinstance(model.as_observed(Weighing(), unknown), Weighing)
    assert isinstance(model.as_observed(IdentityPrior(), "mass"), IdentityPrior)
    with pytest.raises(ConfigError, match="unknown is 'weight'; allowed: mass, radius"):
        model.as_observed(IdentityPrior(), "weight")


class Package:
    """The part of a `Distribution` that is shown."""

    def __init__(self, name: str, version: str) -> None:
        self.name, self.version = name, version


def offer(monkeypatch: pytest.MonkeyPatch, *offered: tuple[str, str, str]) -> None:
    """Let packages of these names offer models: name, value of the entry point, package."""
    entries = []
    for name, value, package in offered:
        entry = EntryPoint(name, value, model.GROUP)
        vars(entry)["dist"] = Package(package, "1.2")
        entries.append(entry)
    monkeypatch.setattr(plugins, "entry_points", lambda group: entries)


def test_a_name_of_two_packages_is_refused_and_names_both(
    asked: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    both = [("mine", "offering:load", "one"), ("mine", "other:load", "two")]
    offer(monkeypatch, *both, ("good", "offering:load", "one"))
    message = (
        r"model 'mine' is offered by package one 1.2 \(offering:load\) and package two 1.2"
        r" \(other:load\); uninstall one of them"
    )
    for look in (model.load_dynamics, model.check_model_name):
        with pytest.raises(ConfigError, match=message):
            look("mine")
    assert isinstance(model.load_dynamics("good"), IdentityPrior)
    assert model.dynamics_names() == ["good", "mine"]


def test_one_package_that_is_found_twice_is_no_conflict(
    asked: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    offer(monkeypatch, *[("mine", "offering:load", "one")] * 2)
    assert isinstance(model.load_dynamics("mine"), IdentityPrior)


@pytest.mark.parametrize(
    ("value", "cause"),
    [
        ("no_such_module:load", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("offering:forgotten", "AttributeError: module 'offering' has no attribute 'forgotten'"),
        ("offering:fails", "ZeroDivisionError: division by zero"),
    ],
)
def test_a_package_that_fails_is_named_and_the_others_work(
    asked: list[str], monkeypatch: pytest.MonkeyPatch, value: str, cause: str
) -> None:
    sys.modules["offering"].fails = lambda name: 1 / 0  # type: ignore[attr-defined]
    offer(monkeypatch, ("mine", value, "their-model"), ("good", "offering:load", "one"))
    message = f"model 'mine' of package their-model 1.2 cannot be loaded: {cause}; repair or"
    with pytest.raises(ConfigError, match=message) as caught:
        model.load_dynamics("mine")
    assert str(caught.value).endswith("Other models: good")
    assert isinstance(model.load_dynamics("good"), IdentityPrior)


def test_a_name_is_checked_without_an_import(
    asked: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    offer(monkeypatch, ("mine", "no_such_module:load", "their-model"))
    model.check_model_name("mine")
    with pytest.raises(ConfigError, match="model 'yours' is unknown; known: mine, or the path"):
        model.check_model_name("yours")


def test_without_any_package_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "entry_points", lambda group: [])
    with pytest.raises(ConfigError, match="none: no installed package has the entry points"):
        model.load_dynamics("sain")
