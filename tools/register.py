"""Registers the packages of src/ in an environment: for import, for plugins, and for `ros2 run`.

    python tools/register.py PREFIX                  what ./env does, in a virtual environment
    python tools/register.py --setup-cfg PACKAGE     the entry points of a package, for colcon

An edit of Python code needs no second call: the packages are used where they stand.
"""

import shutil
import sys
import sysconfig
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PLUGINS = "sain.dynamics"
# The executables of setuptools import for a tenth of a second before any code of ours runs,
# and a Ctrl-C then leaves a traceback. These end quietly from their first line on.
LAUNCHER = """\
#!{python}
# Written by tools/register.py.
if __name__ == "__main__":
    import os, signal, sys
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))
    from {module} import {function}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit({function}())
"""


def main(arguments: list[str]) -> None:
    """Do what the arguments ask for."""
    match arguments:
        case ["--setup-cfg", package]:
            print(setup_cfg(package))
        case [prefix]:
            register(Path(prefix).resolve())
        case _:
            sys.exit(__doc__)


def register(prefix: Path) -> None:
    """Make an environment a prefix of all packages that are there."""
    packages = sorted(path.parent for path in (ROOT / "src").glob("*/*/__init__.py"))
    site = prefix / Path(sysconfig.get_path("purelib")).relative_to(sys.prefix)
    (site / "sain.pth").write_text("".join(f"{package.parent}\n" for package in packages))
    write_metadata(site / f"sain-{PROJECT['version']}.dist-info", {p.name for p in packages})
    index = prefix / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True, exist_ok=True)
    for package in packages:
        (index / package.name).touch()
        link(prefix / "share" / package.name, package.parent)
        programs = prefix / "lib" / package.name
        shutil.rmtree(programs, ignore_errors=True)
        programs.mkdir()
        for name, target in PROJECT["entry-points"].get(package.name, {}).items():
            write_launcher(programs / name, target)
    write_launcher(prefix / "bin/sain", PROJECT["scripts"]["sain"])
    if not shutil.which("ros2", path="/opt/ros/jazzy/bin"):
        link(prefix / "bin/ros2", ROOT / "tools/ros2")


def write_metadata(folder: Path, packages: set[str]) -> None:
    """Write what `importlib.metadata` finds: the version, and the entry points of packages."""
    for old in folder.parent.glob("sain-*.dist-info"):
        shutil.rmtree(old)
    folder.mkdir()
    lines = [f"Name: sain\nVersion: {PROJECT['version']}\nSummary: {PROJECT['description']}\n"]
    (folder / "METADATA").write_text("".join(["Metadata-Version: 2.1\n", *lines]))
    (folder / "INSTALLER").write_text("tools/register.py\n")
    plugins = PROJECT["entry-points"][PLUGINS].items()
    found = [f"{name} = {target}" for name, target in plugins if target.split(".")[0] in packages]
    (folder / "entry_points.txt").write_text("\n".join([f"[{PLUGINS}]", *found, ""]))


def setup_cfg(package: str) -> str:
    """Return the entry points of a package as setuptools reads them."""
    plugins = PROJECT["entry-points"][PLUGINS].items()
    groups = {
        "console_scripts": PROJECT["entry-points"].get(package, {}),
        PLUGINS: {name: target for name, target in plugins if target.split(".")[0] == package},
    }
    lines = ["[options.entry_points]"]
    for group, entries in groups.items():
        lines += [f"{group} =", *(f"    {name} = {target}" for name, target in entries.items())]
    return "\n".join(lines)


def write_launcher(path: Path, target: str) -> None:
    """Write an executable that runs MODULE:FUNCTION."""
    module, function = target.split(":")
    path.write_text(LAUNCHER.format(python=sys.executable, module=module, function=function))
    path.chmod(0o755)


def link(path: Path, target: Path) -> None:
    """Make or renew a symbolic link."""
    path.unlink(missing_ok=True)
    path.symlink_to(target)


if __name__ == "__main__":
    main(sys.argv[1:])
