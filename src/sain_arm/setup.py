from setuptools import find_packages, setup

package_name = "sain_arm"

setup(
    name=package_name,
    version="0.1.0",
    description="Pushes with a robot arm: plans its whole way, checks it, sends it to a controller",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    package_data={"sain_arm": ["robots/*.yaml", "robots/bodies/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["jaxtyping", "numpy", "opencv-python-headless", "rich", "scipy"],
    extras_require={"arm": ["example-robot-data", "mink", "mujoco"]},
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "arm_node = sain_arm.commands:arm_node",
            "enable = sain_arm.commands:enable",
            "trajectory_server = sain_arm.commands:trajectory_server",
        ],
    },
)
