"""Every import and every #include goes where the tables of docs/architecture.md allow it, and none in a circle."""
import ast
from pathlib import Path
import pickle
import re
import subprocess
import sys
from typing import NamedTuple

import pytest

import planar_chain_sim as pcs

ROOT = Path(__file__).resolve().parents[2]
NAME = 'planar_chain_sim'
KERNEL = ROOT / NAME / 'kernel'
INCLUDE = re.compile(r'^\s*#\s*include\s*"(.*)"', re.MULTILINE)
OF_ROS = re.compile(r'rclpy|rcl_interfaces|\w+_(msgs|srvs)|simulation_interfaces|ament\w*|tf2\w*|launch\w*')


class Arrow(NamedTuple):
    """What imports or includes what; modules by their dotted names, headers by their paths."""

    start: str
    end: str


def modules(folder):
    """Return the modules of a package, name -> file, the compiled kernel among them."""
    found = {}
    for path in sorted(folder.rglob('*.py')):
        parts = path.relative_to(folder.parent).with_suffix('').parts
        found['.'.join(parts[:-1] if parts[-1] == '__init__' else parts)] = path
    return {**found, f'{NAME}._kernel': None}


def imports(module, path, known):
    """Yield what a module imports, wherever in it: modules of `known`, and the first part of the name of any other."""
    package = module if path.name == '__init__.py' else module.rpartition('.')[0]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package.split('.')[:len(package.split('.')) + 1 - node.level] if node.level else []
            source = '.'.join([*base, *([node.module] if node.module else [])])
            names = [f'{source}.{alias.name}' if f'{source}.{alias.name}' in known else source for alias in node.names]
        else:
            continue
        for name in names:
            yield name if name in known or not name.startswith(NAME) else name.rpartition('.')[0]


def python_arrows():
    known = modules(ROOT / NAME)
    return sorted({Arrow(module, name) for module, path in known.items() if path
                   for name in imports(module, path, known) if name != module})


def headers():
    """Return the kernel's files by their paths in its folder."""
    return [path.relative_to(KERNEL).as_posix() for kind in ('*.hpp', '*.cpp') for path in sorted(KERNEL.rglob(kind))]


def kernel_arrows():
    return [Arrow(name, (KERNEL / name).parent.joinpath(end).resolve().relative_to(KERNEL).as_posix())
            for name in headers() for end in INCLUDE.findall((KERNEL / name).read_text())]


def room_of(module):
    """Return the room of a module, None for one of another package."""
    parts = module.split('.')
    return None if parts[0] != NAME else NAME if len(parts) == 1 else parts[1].lstrip('_')


def floor_of(header):
    return header.partition('/')[0].removesuffix('.cpp')


def table(heading):
    """Return room -> rooms that it may import, in the order of the table below a heading of the page."""
    section = (ROOT / 'docs/architecture.md').read_text().partition(f'\n## {heading}\n')[2].partition('\n## ')[0]
    rows = [[cell.strip() for cell in line.strip('|').split('|')] for line in section.splitlines() if line[:1] == '|']
    return {row[0].strip('`'): set(re.findall('`(.*?)`', row[2])) for row in rows[2:]}


PYTHON = {'kernel': set(), **table('Python')}
FLOORS = {**table('Kernel'), 'bindings': {*table('Kernel')}}


@pytest.mark.parametrize(('allowed', 'everything', 'arrows', 'place'), [
    (PYTHON, lambda: modules(ROOT / NAME), python_arrows, room_of), (FLOORS, headers, kernel_arrows, floor_of)],
    ids=['python', 'kernel'])
def test_every_arrow_is_allowed_and_every_allowance_is_used(allowed, everything, arrows, place):
    names, used = list(allowed), {name: set() for name in allowed}
    for name, others in allowed.items():
        if name != 'bindings':
            assert others <= set(names[:names.index(name)]), f'{name}: its row allows what does not stand above it'
    for here in map(place, everything()):
        assert here in allowed, f'{here} has no row in docs/architecture.md'
    for start, end in arrows():
        here, there = place(start), place(end)
        if there in (None, here):
            continue
        assert there in allowed[here], f'{start} -> {end}: {here} may not import {there}'
        used[here].add(there)
    unused = {name: allowed[name] - used[name] for name in used if name != 'bindings' and allowed[name] - used[name]}
    assert not unused, f'allowed in docs/architecture.md and never used: {unused}'


@pytest.mark.parametrize('arrows', [python_arrows, kernel_arrows])
def test_there_is_no_circle(arrows):
    """Arrows to modules without outgoing arrows, or from modules without incoming ones, are removed; circles remain."""
    left = set(arrows())
    assert len(left) > 100
    while taken := {arrow for arrow in left if arrow.end not in {each.start for each in left}
                    or arrow.start not in {each.end for each in left}}:
        left -= taken
    assert not left, f'in a circle: {sorted(left)}'


def test_ros_is_imported_in_its_room_and_by_measurements_alone():
    rooms = {room_of(start) for start, end in python_arrows() if OF_ROS.fullmatch(end.partition('.')[0])}
    assert rooms == {'ros', 'benchmark'}


def test_every_file_that_the_page_names_is_there():
    named = re.findall(r'`([\w/]+(?:/|\.py|\.pyi|\.hpp|\.cpp|\.md))`', (ROOT / 'docs/architecture.md').read_text())
    assert len(named) > 40
    assert not [name for name in named if not any((folder / name).exists() for folder in (
        ROOT, ROOT / NAME, KERNEL, KERNEL / 'model'))]


FORMER = {'chain': 'Body Chain ChainError Joint', 'dynamics': 'Interrupted SimulationError', 'loads': 'Wrench',
          'body_poses': 'BodyPoses', 'simulation': 'Checkpoint JointEvent Run Simulation', 'batch': 'BatchRun'}


@pytest.mark.parametrize(('module', 'name'), [(module, name) for module in FORMER for name in FORMER[module].split()])
def test_pickles_of_the_first_version_find_their_classes(module, name):
    """Protocol 0 writes a class as the names of its module and its own; the modules are those of version 0.1."""
    found = f"import pickle; print(pickle.loads(b'c{NAME}.{module}\\n{name}\\n.'))"
    done = subprocess.run([sys.executable, '-c', found], capture_output=True, text=True)
    assert done.stdout == f'{getattr(pcs, name)}\n', done.stderr
    assert pickle.loads(pickle.dumps(getattr(pcs, name))) is getattr(pcs, name)
