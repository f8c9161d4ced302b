from setuptools import find_packages, setup

package_name = "sain_pusht"

setup(
    name=package_name,
    version="0.1.0",
    description="gym-pusht as a world for the agent, with a model of its physics",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    package_data={package_name: ["pusht.*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=[
        "gym-pusht",
        "gymnasium",
        "jaxtyping",
        "numpy",
        "pillow",
        "rich",
        "shapely",
        "tyro",
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "evaluate = sain_pusht.commands:evaluate",
            "learn = sain_pusht.commands:learn",
        ],
    },
)
