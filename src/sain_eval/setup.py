from setuptools import find_packages, setup

package_name = "sain_eval"

setup(
    name=package_name,
    version="0.1.0",
    description="Scenarios, controllers, the closed loop without ROS, statistics and reports",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=[
        "matplotlib",
        "numpy",
        "rich",
        "tyro",
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "evaluate = sain_eval.commands:evaluate",
            "calibrate = sain_eval.commands:calibrate",
            "results = sain_eval.commands:results",
        ],
    },
)
