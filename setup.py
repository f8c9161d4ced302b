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
PACKAGES = ("core", "sim", "model", "mppi", "eval", "bags", "gym", "pusht")
# gym-pusht asks for OpenCV with windows, and MuJoCo for a viewer; both come with their extras only.
OPTIONAL = {"gym-pusht": "pusht"}


def stated(package):
    """Return what the setup.py of a package states."""
    folder, here = ROOT / "src" / f"sain_{package}", Path.cwd()
    os.chdir(folder)
    try:
        return run_setup("setup.py", stop_after="init")
    finally:
        os.chdir(here)


def pinned():
    """Return the requirement of each project whose version is pinned, by its name."""
    files = [
        ROOT / "requirements" / name
        for name in ("ros.in", "python.in", "torch.txt", "bullet.txt", "as_is.txt")
    ]
    found = re.findall(
        r"^([\w.-]+)==(\S+)", "\n".join(path.read_text() for path in files), re.MULTILINE
    )
    return {name.lower().replace("_", "-"): f"{name}=={version}" for name, version in found}


versions = pinned()
packages = {
    f"sain_{name}": stated(name) for name in PACKAGES if (ROOT / "src" / f"sain_{name}").exists()
}
needs, extras, entries, data = set(), {}, {}, {}
for made in packages.values():
    for name in made.install_requires:
        requirement = versions.get(name.lower().replace("_", "-"), name)
        extras.setdefault(OPTIONAL[name], set()).add(
            requirement
        ) if name in OPTIONAL else needs.add(requirement)
    for extra, names in made.extras_require.items():
        extras.setdefault(extra, set()).update(versions.get(name.lower(), name) for name in names)
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
