#!/usr/bin/env python3
"""Resolves requirements/*.in into lock-<Python>-{ros,python}.txt, with every version pinned.

    ./env python tools/lock.py

The set-up installs the two files side by side and without resolving anything, so no package stands
in both; the second one has what as_is.txt lists, too, and PyBullet where it has a wheel. Locks are
made for the Python that runs this; any one with pip will do, for example of a bare environment:

    python3.12 -m venv /tmp/bare && /tmp/bare/bin/pip install -r requirements/pip.txt
    /tmp/bare/bin/python tools/lock.py
"""

import json
import subprocess
import sys
from pathlib import Path

REQUIREMENTS = Path(__file__).resolve().parent.parent / "requirements"
LAST_BULLET_WHEEL = (3, 11)


def resolve(*sources: str) -> dict[str, str]:
    """Name -> version of everything that the sources need."""
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--ignore-installed"]
    command += ["--disable-pip-version-check", "--report", "-"]
    for source in sources:
        command += ["--requirement", str(REQUIREMENTS / source)]
    report = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    packages = (item["metadata"] for item in json.loads(report)["install"])
    return {package["name"].lower(): package["version"] for package in packages}


def pinned(source: str) -> dict[str, str]:
    """Name -> version of what a source lists itself."""
    lines = (REQUIREMENTS / source).read_text().splitlines()
    return dict(line.split("==") for line in lines if not line.startswith("#"))


def write(kind: str, packages: dict[str, str]) -> None:
    path = REQUIREMENTS / f"lock-{sys.version_info.major}.{sys.version_info.minor}-{kind}.txt"
    lines = [f"{name}=={version}" for name, version in sorted(packages.items())]
    path.write_text(f"# Made from {kind}.in by tools/lock.py\n" + "\n".join(lines) + "\n")
    print(f"{path.name}: {len(lines)} packages")


def main() -> None:
    # PyTorch's build is left to the machine; what every build of it needs is locked with the rest.
    resolved = resolve("ros.in", "python.in", "torch.txt")
    everything = {name: resolved[name] for name in resolved if not is_torch_or_cuda(name)}
    ros = {name: everything[name] for name in resolve("ros.in")}
    write("ros", ros)
    python = {name: version for name, version in everything.items() if name not in ros}
    if sys.version_info[:2] <= LAST_BULLET_WHEEL:
        python |= pinned("bullet.txt")
    write("python", python | pinned("as_is.txt"))


def is_torch_or_cuda(name: str) -> bool:
    return name in {"torch", "triton"} or name.startswith(("nvidia-", "cuda-"))


if __name__ == "__main__":
    main()
