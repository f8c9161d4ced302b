from setuptools import find_packages, setup

package_name = "sain_live"

setup(
    name=package_name,
    version="0.1.0",
    description="The live page: the arm, the bodies, plans and goals in a browser",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["jaxtyping", "numpy", "rich", "trimesh", "viser", "websockets"],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "live = sain_live.commands:live",
            "page_node = sain_live.commands:page_node",
        ],
    },
)
