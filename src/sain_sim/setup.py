from setuptools import find_packages, setup

package_name = "sain_sim"

setup(
    name=package_name,
    version="0.1.0",
    description="The simulated world: a Panda arm with a vertical pusher, disks and pushes",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=[
        "jaxtyping",
        "numpy",
        "pybullet",
        "rich",
        "shapely",
    ],
    extras_require={"mujoco": ["mujoco"]},
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "sim_node = sain_sim.commands:sim_node",
            "collect = sain_sim.commands:collect",
        ],
        "sain.dynamics": [
            "bullet = sain_sim.world.shadow:load_bullet",
            "bullet_measured = sain_sim.world.shadow:load_bullet",
        ],
    },
)
