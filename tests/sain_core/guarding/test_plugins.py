"""What packages offer by entry points: found by name, checked, and blamed if it fails."""

import sys
from importlib.metadata import EntryPoint
from types import ModuleType

import pytest

from sain_core.errors import ConfigError
from sain_core.guarding import plugins
from sain_core.guarding.plugins import Plugins, did_you_mean
from sain_core.shapes.bodies import Role

GROUP = "sain.toys"


class Package:
    """The part of a `Distribution` that is shown."""

    name, version = "their-toys", "1.2"


@pytest.fixture
def toys(monkeypatch):
    module = ModuleType("toys")
    module.ball = lambda size: 1 / size  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "toys", module)
    entries = [
        EntryPoint("ball", "toys:ball", GROUP),
        EntryPoint("none", "toys:none", GROUP),
        EntryPoint("twice", "toys:ball", GROUP),
        EntryPoint("twice", "more:ball", GROUP),
    ]
    for entry in entries:
        vars(entry)["dist"] = Package
    monkeypatch.setattr(plugins, "entry_points", lambda group: entries if group == GROUP else [])
    return Plugins(GROUP, "toy", ("kite",))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("bal", r"toy 'bal' is unknown \(did you mean 'ball'\?\); known: ball, kite, none, twice$"),
        (
            "twice",
            r"toy 'twice' is offered by package their-toys 1.2 \(toys:ball\) and package their-toys"
            r" 1.2 \(more:ball\); uninstall one of them",
        ),
    ],
)
def test_a_name_that_leads_nowhere_is_explained(toys, name, message):
    for look in (toys.check, toys.find):
        with pytest.raises(ConfigError, match=message):
            look(name)


def test_a_package_that_cannot_be_loaded_is_named(toys):
    message = (
        "toy 'none' of package their-toys 1.2 cannot be loaded: AttributeError: .*; repair or"
        " uninstall that package. Others: ball, kite, twice"
    )
    with pytest.raises(ConfigError, match=message):
        toys.load(toys.find("none"))


def test_a_module_that_is_there_and_lacks_a_name_is_to_be_repaired(toys, tmp_path, monkeypatch):
    (tmp_path / "lacking.py").write_text("from lacking import nothing\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ConfigError, match=r"of module lacking .*ImportError: .*; repair it"):
        toys.load(EntryPoint("lacking", "lacking:make", GROUP))


def test_a_module_that_exits_is_named_and_ends_nothing(toys, tmp_path, monkeypatch):
    (tmp_path / "leaving.py").write_text("import sys\nsys.exit('no GPU')\n")
    monkeypatch.syspath_prepend(tmp_path)
    message = "cannot be loaded: SystemExit: no GPU; repair it"
    with pytest.raises(ConfigError, match=message):
        toys.load(EntryPoint("leaving", "leaving:make", GROUP))
    with pytest.raises(ConfigError, match=r"toy 'ball' .* failed: SystemExit: 2"):
        toys.guarded(toys.find("ball"), sys.exit)(2)


def test_a_function_that_fails_names_its_package(toys):
    entry = toys.find("ball")
    ball = toys.guarded(entry, toys.load(entry))
    assert ball(2) == 0.5
    message = "toy 'ball' of package their-toys 1.2 failed: ZeroDivisionError: division by zero"
    with pytest.raises(ConfigError, match=message):
        ball(0)


def test_a_package_that_offers_what_is_built_in_is_told_to_rename_it(monkeypatch):
    entry = EntryPoint("kite", "toys:ball", GROUP)
    vars(entry)["dist"] = Package
    monkeypatch.setattr(plugins, "entry_points", lambda group: [entry])
    message = (
        r"toy 'kite' is built in, and offered by package their-toys 1.2 \(toys:ball\), too;"
        r" give that one another name, or uninstall its package"
    )
    toys = Plugins(GROUP, "toy", ("kite", "boat"))
    for _ in range(2):
        with pytest.raises(ConfigError, match=message):
            toys.check("kite")
    toys.check("boat")


@pytest.mark.parametrize(
    ("name", "names", "hint"),
    [
        ("Box", ("box", "disk"), " (did you mean 'box'?)"),
        ("PLUMB BOB", ("plumb_bob",), " (did you mean 'plumb_bob'?)"),
        ("Pushable", Role, " (did you mean 'pushable'?)"),
        ("sphere", ("box", "disk"), ""),
        ("hex", ("disk", "hexagon"), " (did you mean 'hexagon'?)"),
        ("t", ("triangle", "disk"), ""),
    ],
)
def test_a_hint_does_not_depend_on_case_or_space(name, names, hint):
    assert did_you_mean(name, names) == hint
