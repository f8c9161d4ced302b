from setuptools import find_packages, setup

package_name = "sain_lab"

setup(
    name=package_name,
    version="0.1.0",
    description="Laboratories: what is learned where a table stands, push by push",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["jaxtyping", "matplotlib", "numpy", "rich", "torch", "tyro"],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "lab = sain_lab.commands:lab",
            "learner_node = sain_lab.commands:learner_node",
            "teach = sain_lab.commands:teach",
        ],
        "sain.dynamics": ["lab = sain_lab.serving:load_in_service"],
    },
)
