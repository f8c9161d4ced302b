from setuptools import find_packages, setup

package_name = "sain_vision"

setup(
    name=package_name,
    version="0.1.0",
    description="From images to scenes: tags, outlines, tracking and calibration",
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
        "opencv-python-headless",
        "pyyaml",
        "rich",
        "scipy",
        "shapely",
        "tyro",
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "tag_node = sain_vision.commands:tag_node",
            "outline_node = sain_vision.commands:outline_node",
            "scene_node = sain_vision.commands:scene_node",
            "calibrate_camera = sain_vision.commands:calibrate_camera",
            "new_shape = sain_vision.commands:new_shape",
            "print = sain_vision.commands:print",
        ],
    },
)
