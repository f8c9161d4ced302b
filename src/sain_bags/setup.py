from setuptools import find_packages, setup

package_name = "sain_bags"

setup(
    name=package_name,
    version="0.1.0",
    description="Recording to MCAP, and reading recordings back as episodes and datasets",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    package_data={package_name: ["report/page/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=[
        "lz4",
        "matplotlib",
        "mcap",
        "mcap-ros2-support",
        "numpy",
        "pyyaml",
        "rich",
        "rosbags",
        "tyro",
        "zstandard",
    ],
    extras_require={
        "parquet": ["pyarrow"],
        "minari": ["gymnasium", "h5py", "minari"],
        "lerobot": ["lerobot", "torch", "torchvision"],
    },
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "record = sain_bags.commands:record",
            "play = sain_bags.commands:play",
            "view = sain_bags.commands:view",
            "info = sain_bags.commands:info",
            "recover = sain_bags.commands:recover",
            "report = sain_bags.commands:report",
            "to_dataset = sain_bags.commands:to_dataset",
        ],
    },
)
