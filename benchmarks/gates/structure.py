"""How many there are of each thing, from the sources; nothing is run."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from benchmarks.gates.table import Gate
from tools.circles import find_circles, import_graph, own_packages

SOURCE: Final = Path(__file__).resolve().parents[2] / "src"
PACKAGES: Final = ("sain_core", "sain_model", "sain_mppi", "sain_sim", "sain_eval")
DEFINED: Final = re.compile(r"^(?:class|def) (\w+)|^(\w+)(?:: [^=\n]+)? = ", re.MULTILINE)
PROTOCOL: Final = re.compile(r"^class \w+\(.*\bProtocol\b.*\):", re.MULTILINE)
PREDICTING: Final = (
    "Dynamics", "RolloutModel", "RegionModel", "ShapedDynamics", "ShapedRollout",
    "LearningDynamics", "LearningRollout", "BelievingDynamics", "WeighingDynamics",
    "FrictionPhysics", "Impatient",
)  # fmt: skip
FORMS: Final = (
    "PushArray", "PushRecord", "Transitions", "PushHistory", "RecordedPushes", "PendingPush",
    "PairedPushes", "PushStretch", "RecordedPush", "RowBlock", "StrokeOutcome", "ObservedPush",
    "PushAnswer", "PushStory", "LastPush",
)  # fmt: skip
SEARCHES: Final = (
    r"\bscipy\.optimize\b",
    r"\blinalg\.solve\((?s:.*)\blog_density\(",
)  # of parameters
NO_PHYSICS: Final = "sain_model/sain_model/training"  # fits networks and regions
SOLVERS: Final = ("planar_kernels", "push_kernels")  # what steps a push; the first is gone


def measure() -> list[Gate]:
    """Count."""
    sources = read_sources(SOURCE)
    defined = {a or b for text in sources.values() for a, b in DEFINED.findall(text)}
    five = {path: text for path, text in sources.items() if path.parts[0] in PACKAGES}
    lines = sum(text.count("\n") for text in five.values())
    kernels = sum(x.count("\n") for path, x in five.items() if path.stem.endswith("_kernels"))
    stems = {path.stem for path in sources}
    checkpoints = (SOURCE / "sain_model/sain_model/checkpoints").glob("*.safetensors")
    branches = count(r"isinstance\([^()]*\b(?:Pose)?Goal\b|\bGoal \| (?!None)", sources)
    return [
        Gate("contact solvers", len(stems & {*SOLVERS}), before="2", at_most=1),
        Gate("networks that are shipped", len(list(checkpoints)), before="2", at_most=1),
        Gate("Bodies | None", count(r"\bBodies \| None", sources), before="88", at_most=0),
        Gate("branches on the type of a goal", branches, before="71", at_most=0),
        _named("protocols to predict a push", PREDICTING, defined, "11", 2),
        _named("forms of a push", FORMS, defined, "15", 3),
        Gate("fitters of physics", _fitters(sources), before="7", at_most=1),
        Gate("protocols, all", count(PROTOCOL, five)),
        Gate("lines of kernels", kernels),
        Gate("lines of the five packages", lines, before="39,600", at_most=27_000),
        *circles(),
    ]


def read_sources(source: Path) -> dict[Path, str]:
    """Return the text of each Python file of the packages under a folder, by its path there."""
    return {
        path.relative_to(source): path.read_text(encoding="utf-8")
        for package in sorted(source.glob("sain_*"))
        for path in (package / package.name).rglob("*.py")
    }


def count(pattern: str | re.Pattern[str], sources: dict[Path, str]) -> int:
    """Return how often a pattern occurs."""
    return sum(len(re.findall(pattern, text)) for text in sources.values())


def _fitters(sources: dict[Path, str]) -> int:
    """Count the files that search for parameters of the physics."""
    return sum(
        any(re.search(search, text) for search in SEARCHES) and not path.is_relative_to(NO_PHYSICS)
        for path, text in sources.items()
    )


def _named(name: str, known: Iterable[str], defined: set[str], before: str, most: int) -> Gate:
    there = sorted({*known} & defined)
    return Gate(name, len(there), before=before, at_most=most)


def circles() -> list[Gate]:
    """Count circles between files; those of imports for types alone are allowed."""
    packages = own_packages()
    alone, with_types = (find_circles(import_graph(packages, types)) for types in (False, True))
    return [
        Gate("circles between files", len(alone), before="3", at_most=0),
        Gate("circles by imports for types alone", len(with_types) - len(alone)),
    ]
