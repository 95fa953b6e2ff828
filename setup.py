"""The examples stand beside the package in its repository, and in it where it is installed."""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["friso*"]), "friso.examples"],
    package_dir={"friso.examples": "examples"},
    package_data={"friso.examples": ["**/*.toml", "**/*.ini", "**/*.csv", "**/*.mat"]},
)
