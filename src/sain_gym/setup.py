from setuptools import find_packages, setup

package_name = "sain_gym"

setup(
    name=package_name,
    version="0.1.0",
    description="The scenarios as a Gymnasium environment, and the agent as a policy for it",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["gymnasium", "jaxtyping", "numpy"],
    zip_safe=False,
)
