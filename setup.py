"""Build planar_chain_sim: the one source of its metadata, read by pip and by colcon (several times per command)."""
from glob import glob
import os
from pathlib import Path
import sys
import sysconfig

from setuptools import Extension, find_packages, setup

NAME = 'planar_chain_sim'
BUILD_COMMANDS = {'build', 'build_ext', 'install', 'develop', 'bdist_wheel', 'editable_wheel'}


def pybind11_include():
    """Return the folder of pybind11's headers, empty where the compiler's own search path has them."""
    try:
        from pybind11 import get_include
        return [get_include()]
    except ImportError:
        system = any(Path(folder, 'pybind11/pybind11.h').is_file() for folder in ('/usr/include', '/usr/local/include'))
        # colcon builds without isolation, so nobody else installs pybind11; questions about metadata don't need it.
        if not system and '--help' not in sys.argv and BUILD_COMMANDS.intersection(sys.argv):
            sys.exit(f'{NAME} is compiled with pybind11, which {sys.executable} cannot find: '
                     'run `apt install pybind11-dev` or `pip install pybind11`.')
        return []


def without_vain_optimizations():
    """Return flags of gcc alone: without them its -O3 compiles a tenth longer, for code that is no faster."""
    compilers = [os.environ.get('CXX'), os.environ.get('CC'), sysconfig.get_config_var('CC')]
    if sys.platform != 'linux' or 'clang' in ' '.join(filter(None, compilers)):
        return []
    return ['-fno-gcse-after-reload', '-fno-ipa-cp-clone', '-fno-tree-partial-pre']


setup(
    name=NAME,
    version='0.2.0',
    description='Planar chains and trees of rigid bodies, simulated in real time and recorded so that a run repeats '
                'bit for bit.',
    maintainer='planar_chain_sim maintainers',
    maintainer_email='maintainers@example.org',
    license='Apache-2.0',
    python_requires='>=3.10',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    ext_modules=[Extension(
        f'{NAME}._kernel',
        sources=[f'{NAME}/kernel/bindings.cpp'],  # by name: an empty glob would build a module with nothing in it
        depends=sorted(glob(f'{NAME}/kernel/**/*.hpp', recursive=True)),
        include_dirs=pybind11_include(),
        language='c++',
        # The same bits on every IEEE machine: no contraction, no fast-math (not even from CFLAGS), no -march.
        extra_compile_args=['-std=c++17', '-O3', '-ffp-contract=off', '-fno-fast-math', '-fvisibility=hidden', '-g0',
                            '-pthread', *without_vain_optimizations()],
        extra_link_args=['-pthread'],
    )],
    package_data={NAME: ['py.typed', '*.pyi'],
                  f'{NAME}.benchmark': ['*.cpp', 'peers/*.cpp'],   # compiled when a benchmark needs them
                  f'{NAME}.ros': ['fast_dds.xml'],
                  f'{NAME}.pictures': ['page.html'],
                  f'{NAME}.view': ['page/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/config', sorted(glob('config/*.yaml'))),
        (f'share/{NAME}/launch', sorted(glob('launch/*.*'))),
    ],
    include_package_data=False,  # the kernel is installed compiled, its sources stay here
    zip_safe=False,
    install_requires=[
        'mcap>=1.6',    # the log file, with its own lz4 and zstandard; flush() closes a chunk since 1.6
        'numpy>=1.22',  # states and efforts; the reference form of the equations
        'pyyaml',       # the chain file
        'tqdm',         # progress of rollout, resimulate and repair
    ],
    extras_require={
        # ROS 2 Jazzy as wheels, for a machine without ROS; one with ROS from apt must not pull them.
        'ros': [
            'ros-jazzy-rclpy',
            'ros-jazzy-common-interfaces',   # sensor_msgs, std_msgs, std_srvs, diagnostic_msgs, visualization_msgs
            'ros-jazzy-rmw-fastrtps-cpp',    # a real DDS: Jazzy's default
        ],
        # animate, whose MP4 the last one encodes; plot; --picture
        'pictures': ['matplotlib', 'pillow', 'imageio-ffmpeg'],
        'view': ['aiohttp'],     # the page in the browser: HTTP and WebSocket
        'test': [
            'pytest',
            'aiohttp', 'selenium',       # the page, and the browser that looks at it
            'pdoc',                      # the page of the Python API: that it can be written
            'pandas',                    # Log.to_pandas
            'hypothesis',                # random chains, files and messages
            'mpmath',                    # 50-digit reference values
            'sympy',                     # Lagrange's equations from positions alone, symbolically
            'matplotlib', 'pillow', 'imageio-ffmpeg',  # pictures: that they can be drawn
            'mujoco', 'pin',             # independent dynamics libraries as oracles
            'yourdfpy', 'urdfdom-py',    # independent readers of URDF, the second is ROS's own in Python
            'xacro',                     # robot files are expanded with it where it is installed
            'cyclonedds',                # another vendor's DDS, a client of the node
            'rosbags', 'mcap-ros2-support',  # independent readers of the log
            'colcon-common-extensions',  # the ROS 2 build, both layouts
            'setuptools<80',             # 80 dropped `develop --editable`, without which colcon cannot symlink
            'pybind11>=2.11',            # colcon builds without isolation
            'ruff', 'pycodestyle',       # the rules of ament_flake8 and ament_pep257
            'mypy',                      # types
            'clang-format==23.1.5',      # of the kernel; another version formats otherwise
        ],
        'docs': ['pdoc'],               # make docs
        'benchmark': [
            'mujoco', 'pin', 'scipy',    # peers; `drake` is measured too where it is installed
            'heyoka', 'mpmath',          # Taylor integrator, a peer; references in many digits
            'cmeel-eigen<4',             # headers with which pin's are compiled
            'matplotlib', 'pillow',      # pictures
        ],
    },
    entry_points={'console_scripts': [
        f'simulator = {NAME}.ros.node:main',
        f'example_controller = {NAME}.ros.example_controller:main',
        f'replay = {NAME}.ros.replay:main',
        f'rollout = {NAME}.executables:rollout',
        f'resimulate = {NAME}.executables:resimulate',
        f'benchmark = {NAME}.executables:benchmark',
        f'equations = {NAME}.executables:equations',
        f'urdf = {NAME}.executables:urdf',
        f'animate = {NAME}.executables:animate',
        f'plot = {NAME}.executables:plot',
        f'view = {NAME}.executables:view',
        f'info = {NAME}.executables:info',
        f'repair = {NAME}.executables:repair',
    ]},
)
