"""``pip install .``: what needs no ROS 2, as one distribution with the program ``sain``.

Each package under ``src/`` states its own modules, data, dependencies and entry points, in the
``setup.py`` that the workspace builds it with. They are joined here, with the versions that
``requirements/`` has.
"""

import os
import re
from distutils.core import run_setup
from itertools import chain
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent
PACKAGES = ("core", "arm", "sim", "model", "mppi", "eval", "bags", "lab", "gym", "pusht", "vision")
# It asks for OpenCV with windows.
OPTIONAL = {"gym-pusht": "pusht"}


def stated(package):
    """Return what the setup.py of a package states."""
    folder, here = ROOT / "src" / f"sain_{package}", Path.cwd()
    os.chdir(folder)
    try:
        return run_setup("setup.py", stop_after="init")
    finally:
        os.chdir(here)


def key(name):
    """Return the name of a project in the one way of writing it."""
    return name.lower().replace("_", "-")


def pinned():
    """Return the requirement of each project whose version is pinned, by its key."""
    names = ("ros.in", "python.in", "torch.txt", "bullet.txt", "robots.txt", "as_is.txt")
    text = "\n".join((ROOT / "requirements" / name).read_text() for name in names)
    found = re.findall(r"^([\w.-]+)==(\S+)", text, re.MULTILINE)
    return {key(name): f"{name}=={version}" for name, version in found}


versions = pinned()
packages = {
    f"sain_{name}": stated(name) for name in PACKAGES if (ROOT / "src" / f"sain_{name}").exists()
}
needs, extras, entries, data = set(), {}, {}, {}
for made in packages.values():
    for name in made.install_requires:
        chosen = extras.setdefault(OPTIONAL[name], set()) if name in OPTIONAL else needs
        chosen.add(versions.get(key(name), name))
    for extra, names in made.extras_require.items():
        extras.setdefault(extra, set()).update(versions.get(key(name), name) for name in names)
    data |= made.package_data or {}
    for group, lines in (made.entry_points or {}).items():
        if group != "console_scripts":
            entries.setdefault(group, []).extend(lines)

setup(
    name="sain",
    version="0.1.0",
    description="Closed-loop pushing with learned residual physics",
    license="Apache-2.0",
    python_requires=">=3.11",
    packages=list(chain.from_iterable(made.packages for made in packages.values())),
    package_dir={name: f"src/{name}/{name}" for name in packages},
    package_data=data,
    install_requires=sorted(needs),
    extras_require={name: sorted(some) for name, some in extras.items()},
    entry_points=entries | {"console_scripts": ["sain = sain_core.cli.program:main"]},
    zip_safe=False,
)
