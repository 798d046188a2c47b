"""The package `robochoc_ros`, for colcon. robochoc itself is installed by pip: `pip install 'robochoc[dds]'`."""

from pathlib import Path

from setuptools import setup

NAME = "robochoc_ros"

setup(
    name=NAME,
    version="1.0.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", sorted(map(str, Path("launch").glob("*.launch.py")))),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="You",
    maintainer_email="you@example.org",
    description="Launch files that start robochoc with a team.",
    license="Apache-2.0",
)
