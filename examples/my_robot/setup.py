from setuptools import setup

setup(
    name="my_robot",
    version="0.1.0",
    description="A robot of your own for SAIN: a driver to copy",
    license="Apache-2.0",
    packages=["my_robot"],
    package_data={"my_robot": ["bodies.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/my_robot"]),
        ("share/my_robot", ["package.xml"]),
        ("share/my_robot/launch", ["launch/my_robot.launch.py"]),
    ],
    entry_points={"console_scripts": ["robot_node = my_robot.robot_node:main"]},
)
