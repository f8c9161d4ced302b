from setuptools import find_packages, setup

package_name = "sain_model"

setup(
    name=package_name,
    version="0.1.0",
    description="Physics priors, and the interaction network that learns their residual",
    license="Apache-2.0",
    maintainer="SAIN maintainers",
    maintainer_email="sain@example.org",
    packages=find_packages(),
    package_data={package_name: ["checkpoints/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=[
        "jaxtyping",
        "matplotlib",
        "numba",
        "numpy",
        "rich",
        "safetensors",
        "scipy",
        "torch",
        "tyro",
    ],
    extras_require={"tensorboard": ["tensorboardX"]},
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "model_node = sain_model.commands:model_node",
            "train = sain_model.commands:train",
            "evaluate = sain_model.commands:evaluate",
            "identify = sain_model.commands:identify",
            "real_import = sain_model.commands:real_import",
            "learning_curve = sain_model.commands:learning_curve",
        ],
        "sain.dynamics": [
            "planar = sain_model.dynamics.priors:load_prior",
            "planar_axes = sain_model.dynamics.priors:load_prior",
            "identity = sain_model.dynamics.priors:load_prior",
            "sain = sain_model.dynamics.load:load_builtin",
            "checkpoint = sain_model.dynamics.load:load_builtin",
        ],
    },
)
