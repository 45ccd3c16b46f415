# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
from glob import glob
from pathlib import Path
import sys

from setuptools import find_packages, setup

PACKAGE = 'rigid_sim_ros'
HERE = Path(__file__).resolve().parent    # --symlink-install runs a link to this file, elsewhere

# The ROS executables have plain names (`view` is also an editor): right under lib/rigid_sim_ros,
# where `ros2 run` looks, and wrong on everybody's PATH. colcon and bloom run `setup.py install` or
# `develop`, and setup.cfg sends the scripts there; pip builds a wheel, whose scripts go to bin/.
ROS_EXECUTABLES = [
    'replay = rigid_sim_ros.programs:replay',
    'simulate = rigid_sim_ros.programs:simulate',
    'view = rigid_sim_ros.programs:view',
]
FOR_ROS = bool({'develop', 'install'} & set(sys.argv))

ROS_WHEELS = [
    'ros-jazzy-common-interfaces',
    'ros-jazzy-rclpy',               # brings rosgraph_msgs and ament_index_python too
    'ros-jazzy-rmw-fastrtps-cpp',    # rclpy cannot be imported without a middleware beside it
]

EXPORT = ['pyarrow>=14']    # 100 MB, and only `rigid_sim export` needs it
MJCF = ['mujoco>=3.2']
XACRO = ['xacro>=2.0']
PLOT = ['matplotlib>=3.8', 'plotly>=5.15']
RENDER = ['av>=12.0', 'pillow>=10.1', 'pyvista>=0.44', 'vtk>=9.4']      # VTK unpacks to 600 MB

# The page: it brings its own browser client, so that nothing is loaded from the internet.
VIEW = ['viser>=1.1,<2']

setup(
    name=PACKAGE,
    version='0.1.0',
    description='Rigid bodies that live in a ROS 2 node, simulated in momentum form',
    long_description=(HERE / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    author='The rigid_sim_ros authors',
    maintainer='The rigid_sim_ros authors',
    maintainer_email='maintainers@users.noreply.h-seed-5362e900.example',
    license='Apache-2.0',
    python_requires='>=3.10',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    # msg_config in the package is a link to the folder above, so that the defaults are found in a
    # checkout, in a wheel and in a colcon workspace alike.
    package_data={PACKAGE: ['py.typed', 'example_scenes/*', 'msg_config/*', 'viewer/*.js']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/launch', sorted(glob('launch/*.launch.py'))),
        (f'share/{PACKAGE}/msg_config', sorted(glob('msg_config/*'))),
    ],
    zip_safe=False,
    install_requires=[
        'click>=8.1',
        'defusedxml>=0.7.1',
        'llvmlite>=0.42',
        'lz4>=4.0',
        'mcap>=1.1',
        'numba>=0.59,<0.69',
        'numpy>=1.26',
        'osqp>=1.0',
        'pycollada>=0.7',
        'pydantic>=2.5',
        'pyyaml>=6.0',
        'rich>=13.0',
        'rosbags>=0.10.9',
        'ruamel.yaml>=0.17.21',
        'scipy>=1.11.1',
        'trimesh>=4.0',
        'zstandard>=0.18',
    ],
    extras_require={
        'export': EXPORT,
        'mjcf': MJCF,
        'plot': PLOT,
        'render': RENDER,
        'ros': [*ROS_WHEELS, *VIEW],
        'test': [*EXPORT, *MJCF, *PLOT, *RENDER, *ROS_WHEELS, *VIEW, *XACRO,
                 'colcon-common-extensions',
                 'hypothesis', 'mcap-ros2-support', 'playwright>=1.40', 'pytest',
                 'pytest-xdist>=3.7'],
        'view': VIEW,
        'xacro': XACRO,
        'lint': [
            'flake8',
            'flake8-blind-except',
            'flake8-builtins',
            'flake8-class-newline',
            'flake8-comprehensions',
            'flake8-deprecated',
            'flake8-docstrings',
            'flake8-import-order',
            'flake8-quotes',
            'mypy',
            'pydocstyle',
            'ruff',
        ],
    },
    entry_points={
        'console_scripts': [
            'rigid_sim = rigid_sim_ros.programs:rigid_sim',
            *(ROS_EXECUTABLES if FOR_ROS else []),
        ],
    },
)
