from pathlib import Path

from setuptools import find_packages, setup

package_name = "sain_bringup"

setup(
    name=package_name,
    version="0.1.0",
    description="Launch files, configuration and the closed loop on the whole graph",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
        (f"share/{package_name}/launch", sorted(map(str, Path("launch").glob("*.launch.py")))),
        (f"share/{package_name}/config", sorted(map(str, Path("config").glob("*.*")))),
    ],
    install_requires=["jaxtyping", "numpy", "pillow", "rich", "tyro"],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "closed_loop = sain_bringup.commands:closed_loop",
            "graph = sain_bringup.commands:graph",
            "laboratory = sain_bringup.commands:laboratory",
            "goal = sain_bringup.commands:goal",
            "push = sain_bringup.commands:push",
            "reset = sain_bringup.commands:reset",
            "watch = sain_bringup.commands:watch",
        ],
    },
)
