"""
The source distribution, and both layouts of `colcon build` made from it.

Executables, configuration, ament marker, and a kernel from the install tree.
"""
import ast
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import tarfile
from xml.etree import ElementTree

import pytest

import planar_chain_sim

ROOT = Path(__file__).resolve().parents[2]
NAME = 'planar_chain_sim'
EXECUTABLES = ['animate', 'benchmark', 'equations', 'example_controller', 'info', 'plot', 'repair', 'replay',
               'resimulate', 'rollout', 'simulator', 'urdf', 'view']
LAYOUTS = {'copied': [], 'linked': ['--symlink-install']}
NOT_SOURCES = shutil.ignore_patterns('.*', 'build', 'install', 'log', 'dist', '*.egg-info', '__pycache__', '*.so',
                                     'MUJOCO_LOG.TXT')


def not_sources(folder, names) -> set:
    """Return which files and folders of `folder` are not the project's; whoever tries it leaves pictures and logs."""
    ignored, tracked = NOT_SOURCES(folder, names), subprocess.run(
        ['git', 'ls-files', '-z'], cwd=folder, capture_output=True, text=True).stdout.split('\0')
    first = {name.partition('/')[0] for name in tracked if name}
    return ignored | (set(names) - first if first else set())


# Both layouts have the same sources: they are compiled once, without optimisation and wide vectors, as nothing here is
# timed.
COMPILER = """#!/bin/sh
case " $* " in *' -c '*) ;; *) exec {compiler} "$@" ;; esac
for word; do [ "$last" = -o ] && output=$word; last=$word; done
[ -e {kept} ] || {compiler} "$@" -O0 -DPLANAR_CHAIN_NARROW -o {kept} || exit 1
cp {kept} "$output"
"""


def colcon(workspace, *arguments, **environment):
    """Start colcon in a workspace, with an interpreter's own colcon before any other."""
    path = os.pathsep.join([os.path.dirname(sys.executable), os.environ['PATH']])
    program = shutil.which('colcon', path=path)
    assert program, 'colcon is missing: pip install colcon-common-extensions'
    return subprocess.Popen([program, *arguments], cwd=workspace, env={**os.environ, 'PATH': path, **environment},
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


@pytest.fixture(scope='module')
def distribution(tmp_path_factory):
    """Return a copy of the sources, and the unpacked source distribution that was made from it."""
    folder = tmp_path_factory.mktemp('distribution')
    source = shutil.copytree(ROOT, folder / 'source', ignore=not_sources)
    shutil.copytree(source, folder / 'work')   # setup.py leaves files behind
    subprocess.run([sys.executable, 'setup.py', '-q', 'sdist', '-d', folder], cwd=folder / 'work', check=True,
                   capture_output=True)
    archive, = folder.glob('*.tar.gz')
    with tarfile.open(archive) as opened:
        opened.extractall(folder / 'unpacked')
    unpacked, = (folder / 'unpacked').iterdir()
    return source, unpacked


@pytest.fixture(scope='module')
def workspaces(distribution, tmp_path_factory):
    """Build the source distribution in each layout and return the workspaces."""
    tools = tmp_path_factory.mktemp('tools')
    compiler = tools / 'compiler'
    compiler.write_text(COMPILER.format(compiler=os.environ.get('CXX', 'c++'), kept=tools / 'kernel.o'))
    compiler.chmod(0o755)
    folders = {layout: tmp_path_factory.mktemp(layout) for layout in LAYOUTS}
    for folder in folders.values():
        shutil.copytree(distribution[1], folder / 'src' / NAME)
    for layout, options in LAYOUTS.items():
        build = colcon(folders[layout], 'build', *options, CC=str(compiler), CXX=str(compiler))
        output, _ = build.communicate(timeout=1800)
        assert build.returncode == 0, output
        assert "doesn't explicitly install" not in output  # colcon adds a missing marker or package.xml, with a warning
    assert (tools / 'kernel.o').exists(), 'the builds have used another compiler'
    return folders


@pytest.fixture(params=LAYOUTS)
def workspace(request, workspaces):
    """Return the workspace of one layout."""
    return workspaces[request.param]


def run_installed(workspace, *command):
    """Run a command in a shell that has sourced the workspace, away from all sources."""
    return subprocess.run(['bash', '-c', '. "$0/install/setup.bash" && exec "$@"', workspace, *command],
                          cwd=workspace.parent, capture_output=True, text=True, timeout=600)


@pytest.mark.slow
def test_installed_files_are_where_ros_looks(workspace):
    prefix = workspace / 'install' / NAME
    executables = sorted((prefix / 'lib' / NAME).iterdir())
    assert [path.name for path in executables] == EXECUTABLES
    assert all(os.access(path, os.X_OK) for path in executables)
    assert (prefix / 'share/ament_index/resource_index/packages' / NAME).is_file()
    assert (prefix / 'share' / NAME / 'package.xml').read_text() == (ROOT / 'package.xml').read_text()
    shipped = {path.name: path.read_text() for path in (ROOT / 'config').iterdir()}
    assert {path.name: path.read_text() for path in (prefix / 'share' / NAME / 'config').iterdir()} == shipped
    assert 'four_link_robot.yaml' in shipped
    started = {path.name: path.read_text() for path in (ROOT / 'launch').iterdir() if path.is_file()}
    assert {path.name: path.read_text() for path in (prefix / 'share' / NAME / 'launch').iterdir()} == started
    assert {'view.launch.py', 'view.rviz', 'two_arms.launch.py', 'two_arms.yaml'} <= {*started}


@pytest.mark.slow
def test_kernel_and_modules_come_from_the_workspace(workspace):
    names = [NAME, f'{NAME}._kernel', *(f'{NAME}.{folder.name}' for folder in (ROOT / NAME).iterdir()
                                        if (folder / '__init__.py').exists())]
    places = run_installed(workspace, sys.executable, '-c', 'import importlib, sys\n'
                           'for name in sys.argv[1:]: print(importlib.import_module(name).__file__)', *names)
    assert places.returncode == 0, places.stderr
    for place in places.stdout.split():
        assert workspace in Path(place).resolve().parents
    package = Path(places.stdout.split()[0]).parent
    page = (path.relative_to(ROOT / NAME) for path in (ROOT / NAME / 'view/page').iterdir())
    for beside in ('py.typed', '__init__.pyi', 'ros/fast_dds.xml', *page):
        assert (package / beside).read_text() == (ROOT / NAME / beside).read_text()


@pytest.mark.slow
def test_chain_file_is_found_in_the_ament_index(workspace):
    place = run_installed(workspace, sys.executable, '-c', f'from {NAME}.chain_file import find_chain_file\n'
                          "print(find_chain_file('four_link_robot.yaml'))")
    expected = workspace / 'install' / NAME / 'share' / NAME / 'config/four_link_robot.yaml'
    assert place.stdout.strip() == str(expected), place.stderr


@pytest.mark.slow
@pytest.mark.parametrize('name', EXECUTABLES)
def test_executable_shows_help(workspace, name):
    shown = run_installed(workspace, workspace / 'install' / NAME / 'lib' / NAME / name, '--help')
    assert shown.returncode == 0, shown.stderr
    assert name in shown.stdout


@pytest.mark.slow
def test_colcon_test_tests_what_is_installed(workspaces):
    workspace = workspaces['copied']
    run = colcon(workspace, 'test', '--event-handlers', 'console_direct+',
                 '--return-code-on-test-failure', '--pytest-args', 'test/packaging/test_packaging.py',
                 '-k', 'test_the_kernel_loads_from_its_own_package')
    output, _ = run.communicate(timeout=600)
    assert run.returncode == 0 and '1 passed' in output, output


def test_the_kernel_loads_from_its_own_package():
    # an editable install elsewhere would lend its kernel to a package without one
    from planar_chain_sim import _kernel
    assert Path(_kernel.__file__).parent == Path(planar_chain_sim.__file__).parent


ROSDEP_KEYS = {'aiohttp': 'python3-aiohttp', 'imageio_ffmpeg': 'ffmpeg', 'lz4': 'mcap-ros2-support',
               'matplotlib': 'python3-matplotlib', 'mcap': 'mcap-ros2-support', 'numpy': 'python3-numpy',
               'PIL': 'python3-pil', 'pyyaml': 'python3-yaml', 'tqdm': 'python3-tqdm', 'yaml': 'python3-yaml',
               'zstandard': 'mcap-ros2-support'}
USED_IF_INSTALLED = {'heyoka', 'mpmath', 'mujoco', 'pandas', 'pinocchio', 'pydrake', 'scipy', 'simulation_interfaces'}


def run_dependencies():
    """Return the rosdep keys of package.xml that are needed to run."""
    return {part.text for part in ElementTree.parse(ROOT / 'package.xml').getroot().iter('exec_depend')}


def imported_packages(path):
    """Return the top-level packages that a source file imports from outside."""
    nodes = list(ast.walk(ast.parse(path.read_text())))
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module for node in nodes if isinstance(node, ast.ImportFrom) and not node.level]
    return {name.partition('.')[0] for name in names} - sys.stdlib_module_names - {NAME}


def test_rosdep_installs_what_pip_does():
    listed = re.search(r'install_requires=\[(.*?)\]', (ROOT / 'setup.py').read_text(), re.DOTALL).group(1)
    needed = re.findall(r"'([a-z0-9-]+)", listed)
    assert needed and {ROSDEP_KEYS[name] for name in needed} <= run_dependencies()


def test_rosdep_installs_all_that_is_imported():
    sources = [*(ROOT / NAME).rglob('*.py'), *(ROOT / 'launch').glob('*.py')]
    imported = set().union(*map(imported_packages, sources)) - USED_IF_INSTALLED
    assert {'numpy', 'rclpy', 'launch_ros'} <= imported
    assert {ROSDEP_KEYS.get(name, name) for name in imported} <= run_dependencies()


def test_metadata_agrees():
    package = ElementTree.parse(ROOT / 'package.xml').getroot()
    maintainer = package.find('maintainer')
    fields = {'--name': package.findtext('name'), '--version': package.findtext('version'),
              '--description': package.findtext('description'), '--license': package.findtext('license'),
              '--maintainer': maintainer.text, '--maintainer-email': maintainer.get('email')}
    setup = subprocess.run([sys.executable, 'setup.py', *fields], cwd=ROOT, capture_output=True, text=True)
    assert setup.stdout.splitlines() == list(fields.values()), setup.stderr
    assert planar_chain_sim.__version__ == package.findtext('version')


def test_the_source_distribution_has_all_that_builds_and_tests_the_package(distribution):
    """Headers, tests, configuration and documents are in it; the builds of colcon start from it."""
    wanted, packed = ({str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob('*') if path.is_file()}
                      for folder in distribution)
    wanted['setup.cfg'] = packed['setup.cfg']   # setuptools adds a section
    wanted.pop('PKG-INFO', None)   # of an unpacked source distribution; each version of setuptools writes its own
    assert len(wanted) > 200
    assert {name for name, text in wanted.items() if packed.get(name) != text} == set()
