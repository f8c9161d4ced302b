"""The packages that may be deleted: without them everything else is imported, listed and set up."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from tests.paths import ROOT
from tests.workspace.source_tree import PYTHON_PACKAGES, SOURCE

OPTIONAL = ("sain_gym", "sain_live")  # a policy's environment, a view
OTHERS = tuple(name for name in PYTHON_PACKAGES if name not in OPTIONAL)
IMPORT_ALL = """
import importlib.util, json, sys
from pathlib import Path
sys.path[:] = [p for p in sys.path if not any((Path(p) / name).is_dir() for name in {optional})]
assert not any(map(importlib.util.find_spec, {optional}))
for name in {modules}:
    importlib.import_module(name)
    assert sys.modules[name].__file__.startswith({root!r}), sys.modules[name].__file__
from sain_core.cli.program import find_commands, main
assert main(["--help"]) == 0
sys.stderr.write(json.dumps(sorted({{one.name.split()[0] for one in find_commands().values()}})))
"""


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A copy of what `pip install .` needs, without the optional packages."""
    copy = tmp_path_factory.mktemp("tree")
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, copy)
    skipped = shutil.ignore_patterns("__pycache__", *OPTIONAL)
    shutil.copytree(SOURCE, copy / "src", ignore=skipped)
    return copy


def test_all_others_are_imported_and_listed_without_them(tree):
    modules = [
        ".".join(path.relative_to(tree / "src" / package).with_suffix("").parts)
        for package in OTHERS
        for path in sorted((tree / "src" / package / package).rglob("*.py"))
        if path.name != "__init__.py"
    ]
    assert len(modules) > 200
    code = IMPORT_ALL.format(optional=OPTIONAL, modules=modules, root=str(tree))
    places = os.pathsep.join(str(tree / "src" / package) for package in OTHERS)
    paths = os.pathsep.join([places, os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tree,
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: sain COMMAND")
    listed = json.loads(done.stderr.splitlines()[-1])
    assert set(listed) == {
        name for name in OTHERS if (SOURCE / name / name / "commands.py").exists()
    }


def test_the_distribution_is_set_up_without_them(tree):
    command = [sys.executable, "-c", "import setuptools; setuptools.setup()", "-q", "egg_info"]
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    entries = (tree / "sain.egg-info" / "entry_points.txt").read_text()
    assert "sain = sain_core.cli.program:main" in entries and "checkpoint = " in entries
    packages = (tree / "sain.egg-info" / "top_level.txt").read_text().split()
    assert "sain_core" in packages and not set(OPTIONAL) & set(packages)
