from setuptools import find_packages, setup

package_name = "sain_core"

setup(
    name=package_name,
    version="0.1.0",
    description="Scenes, pushes, the dynamics protocol and what every other package shares",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    package_data={"sain_core.guarding": ["loopback.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=[
        "jaxtyping",
        "joblib",
        "matplotlib",
        "numpy",
        "opencv-python-headless",
        "pillow",
        "pyyaml",
        "rich",
        "shapely",
        "tyro",
    ],
    extras_require={"ray": ["ray"]},
    zip_safe=False,
)
