from setuptools import find_packages, setup

package_name = "sain_mppi"

setup(
    name=package_name,
    version="0.1.0",
    description="Model predictive path integral planning of pushes",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["jaxtyping", "numpy"],
    zip_safe=False,
    entry_points={"console_scripts": ["mppi_node = sain_mppi.commands:mppi_node"]},
)
