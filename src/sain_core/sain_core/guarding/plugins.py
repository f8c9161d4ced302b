"""Things of one kind that installed packages offer by name, in a group of entry points.

    [project.entry-points."sain.planners"]
    my_planner = "my_package:plan"

An error names the package. A package that fails does not disturb the others.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import wraps
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from sain_core.errors import ConfigError, SainError

T = TypeVar("T")


class Plugins:
    """All of one kind: those that packages offer, besides those that are built in."""

    def __init__(
        self,
        group: str,
        what: str,
        built_in: Iterable[str] = (),
        hidden: Iterable[str] = (),
        more: str = "",
    ) -> None:
        """Look in a group of entry points for what messages call `what`.

        `built_in` are names that no package may offer, `hidden` ones are not listed, and `more` is
        what messages say may be given besides names.
        """
        self.group, self.what = group, what
        self._built_in, self._hidden, self._more = tuple(built_in), set(hidden), more
        self._checked: set[str] = set()

    def names(self) -> list[str]:
        """Return all names, those that are built in, too."""
        return sorted({*self._built_in, *self.entries()} - self._hidden)

    def entries(self) -> dict[str, list[EntryPoint]]:
        """Return the entry points of each name; more than one where packages contradict.

        What is installed twice, in a workspace and with pip, is one.
        """
        offered: dict[str, dict[str, EntryPoint]] = {}
        for entry in entry_points(group=self.group):
            offered.setdefault(entry.name, {})[entry.value] = entry
        return {name: list(entries.values()) for name, entries in offered.items()}

    def check(self, name: str) -> None:
        """Check that one package offers a name, or that it is built in; nothing is imported."""
        if name in self._checked:
            return
        if name not in self._built_in:
            self.find(name)
        elif entries := self.entries().get(name):
            raise ConfigError(
                f"{self.what} {name!r} is built in, and offered by {_described(entries)}, too;"
                " give that one another name, or uninstall its package"
            )
        self._checked.add(name)  # to look takes some ms

    def find(self, name: str) -> EntryPoint:
        """Return the only entry point of a name; raises `ConfigError`: none has it, or two."""
        entries = self.entries().get(name, [])
        if not entries:
            names = self.names()
            none = f"none: no installed package has the entry points {self.group!r}"
            known = ", ".join(names) or none
            near = did_you_mean(name, names)
            hint = "" if near else "; a package of your own must be installed first"
            raise ConfigError(
                f"{self.what} {name!r} is unknown{near}; known: {known}{self._more}{hint}"
            )
        return self.only(name, entries)

    def only(self, name: str, entries: list[EntryPoint]) -> EntryPoint:
        """Return the one entry point; raise `ConfigError` where there are more."""
        if len(entries) > 1:
            raise ConfigError(
                f"{self.what} {name!r} is offered by {_described(entries)}; uninstall one of them"
            )
        return entries[0]

    def load(
        self, entry: EntryPoint, make: Callable[[Any], Any] = lambda it: it, name: str = ""
    ) -> Any:
        """Return what is made of what an entry point leads to, or raise `ConfigError`."""
        with self._blaming(entry, "cannot be loaded", name):
            return make(entry.load())

    def guarded(self, entry: EntryPoint, work: Callable[..., T]) -> Callable[..., T]:
        """Return a function whose errors, but for a `SainError`, name the package."""

        @wraps(work)
        def call(*given: Any) -> T:
            with self._blaming(entry, "failed"):
                return work(*given)

        return call

    def function(self, name: str) -> tuple[EntryPoint, Callable[..., Any]]:
        """Return who offers a function by a name, and that function, `guarded`."""
        entry = self.find(name)
        work = self.load(entry)
        if not callable(work):
            kind = type(work).__name__
            raise self.wrong(entry, f"{entry.value} is a {kind}; it must be a function")
        return entry, self.guarded(entry, work)

    @contextmanager
    def _blaming(self, entry: EntryPoint, what: str, name: str = "") -> Iterator[None]:
        try:
            yield
        except SainError:
            raise
        except (Exception, SystemExit) as error:  # a package ends no process that loads it
            others = ", ".join(other for other in self.names() if other != entry.name) or "none"
            advice = f"repair or uninstall that package. Others: {others}"
            if entry.dist is None:
                lacks = error.name if isinstance(error, ModuleNotFoundError) else None
                absent = f"{entry.module}.".startswith(f"{lacks}.")
                advice = "is its folder on PYTHONPATH?" if absent else "repair it"
            raise ConfigError(
                f"{self.what} {(name or entry.name)!r} of {package_of(entry)} {what}:"
                f" {type(error).__name__}: {error}; {advice}"
            ) from error

    def wrong(self, entry: EntryPoint, problem: str, name: str = "") -> ConfigError:
        """Return the error about an offer that is not what it should be."""
        return ConfigError(
            f"{self.what} {(name or entry.name)!r} of {package_of(entry)}: {problem}"
        )


def did_you_mean(name: str, names: Iterable[str], alike: float = 0.6) -> str:
    """Return a hint at the nearest name, in whatever case; empty: none is near."""
    near = nearest(name, names, alike)
    return f" (did you mean {near[0]!r}?)" if near else ""


def nearest(name: str, names: Iterable[str], alike: float = 0.6, count: int = 1) -> list[str]:
    """Return the names that are most like another one, in whatever case; the best first."""
    by_plain = {_plain(one): str(one) for one in names}  # a member of an enum, too
    given = _plain(name)
    longer = [one for one in by_plain if len(given) > 1 and one.startswith(given)]
    near = get_close_matches(given, by_plain, count, alike) or longer[:count]
    return [by_plain[one] for one in near]


def _plain(name: str) -> str:
    return name.strip().casefold().replace("-", "_").replace(" ", "_")


def package_of(entry: EntryPoint) -> str:
    """Return name and version of the package that offers something."""
    if entry.dist is None:
        return f"module {entry.module}"
    return f"package {entry.dist.name} {entry.dist.version}"


def _described(entries: Iterable[EntryPoint]) -> str:
    return " and ".join(f"{package_of(entry)} ({entry.value})" for entry in entries)
