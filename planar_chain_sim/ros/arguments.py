"""
Checks a ROS command line for mistakes that ROS ignores silently or reports in unclear words.

Nothing is changed: ROS parses the same arguments.
"""
from __future__ import annotations

from itertools import islice
from pathlib import Path
import re
import shlex
from typing import Any, Iterator, Sequence

import yaml

from ..errors import Mistake

LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
WITH_VALUE = ('-p', '--param', '-r', '--remap', '--params-file', '--log-level', '--log-config-file')
INTEGER = re.compile(r'[-+]?\d+')
DECIMAL = re.compile(r'[-+]?((\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|\.(inf|Inf|INF)|\.(nan|NaN|NAN))')
NODE_RULE = re.compile(r'([A-Za-z_]\w*):[A-Za-z_][\w.]*:=.*', re.DOTALL)


def refuse_misplaced(program: str, own: Sequence[str], ros: Sequence[str]) -> None:
    """Raise Mistake, with what to type, for an argument of ROS that stands before any --ros-args."""
    for place, argument in enumerate(own):
        if argument in WITH_VALUE or ':=' in argument:
            files, misplaced = _parted(own[place:])
            rest = [each for each in ros if each not in ('--ros-args', '--')]
            meant = shlex.join([program, *own[:place], *files, '--ros-args', *misplaced, *rest])
            raise Mistake(f'{argument!r} is for ROS, whose arguments come after --ros-args: {meant}')


def _parted(arguments: Sequence[str]) -> tuple[list, list]:
    """Return of mixed arguments those of the program, and those of ROS with the flag that they need."""
    own, ros, rest = [], [], iter(arguments)
    for argument in rest:
        name, assigned, value = argument.partition(':=')
        if argument in WITH_VALUE:
            ros += [argument, *islice(rest, 1)]
        elif assigned:
            ros += ['-r' if value[:1] == '/' or name[:2] == '__' else '-p', argument]
        elif argument == '--hold':
            own += [argument, *islice(rest, 1)]
        else:
            (ros if argument.startswith(('--enable-', '--disable-')) else own).append(argument)
    return own, ros


def refuse_mixed_lists(ros: Sequence[str]) -> None:
    """Raise Mistake for a parameter whose list mixes whole numbers and decimals, which ROS takes for two types."""
    for flag, value in _pairs(ros):
        if flag in ('-p', '--param') and ':=' in value:
            name, _, text = value.partition(':=')
            for _, _, numbers in _mixed_lists(text):
                raise Mistake(f'parameter {name!r} mixes whole numbers and decimals in a list, which ROS refuses: '
                              f"write -p {name}:='{numbers}'")
        elif flag == '--params-file':
            for name, line, numbers in _mixed_lists(_text(value)):
                raise Mistake(f'parameter file {value!r} line {line}: {name!r} mixes whole numbers and decimals in a '
                              f'list, which ROS refuses: write {numbers}')


def unheard(ros: Sequence[str], full_name: str) -> Iterator[str]:
    """Yield a sentence for every parameter file, and every -p, that is for other nodes than the one of this name."""
    for flag, value in _pairs(ros):
        if flag == '--params-file':
            headings = list(_headings(_text(value)))
            if not headings:
                yield (f"parameter file {value!r} has no parameters: they stand under '{full_name}:' or '/**:' and "
                       "under 'ros__parameters:'")
            elif not any(_matches(heading, full_name) for heading in headings):
                yield (f'parameter file {value!r} has nothing for this node, {full_name}, only for '
                       f"{', '.join(headings[:8])}: use the heading '{full_name}:' or '/**:'")
        elif flag in ('-p', '--param'):
            rule = NODE_RULE.fullmatch(value)
            if rule and rule.group(1) != full_name.rpartition('/')[2]:
                yield f'parameter {value!r} is for a node {rule.group(1)!r}, this is {full_name}: leave the name out'


def _pairs(ros: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the arguments that take a value, with it."""
    arguments = iter(ros)
    for argument in arguments:
        if argument in WITH_VALUE:
            yield argument, next(arguments, '')


def _text(path: str) -> str:
    """Return the text of a file, '' where it cannot be read: ROS says so."""
    try:
        return Path(path).read_text('utf-8')
    except (OSError, ValueError):
        return ''


def _events(text: str) -> Iterator:
    """Yield the events of a YAML text up to its end or its first error, which ROS reports."""
    try:
        yield from yaml.parse(text, LOADER)
    except yaml.YAMLError:
        return


def _mixed_lists(text: str) -> Iterator[tuple[str, int, str]]:
    """Yield name, line and correct text of every list that holds whole numbers beside other numbers."""
    name, line = '', 0
    items: Any = None
    for event in _events(text):
        if isinstance(event, yaml.SequenceStartEvent):
            items, line = [], event.start_mark.line + 1
        elif isinstance(event, yaml.SequenceEndEvent):
            whole = [bool(INTEGER.fullmatch(item)) for item in items or ()]
            if any(whole) and not all(whole) and all(map(DECIMAL.fullmatch, items)):
                yield name, line, f'[{", ".join(item + ".0" * each for item, each in zip(items, whole))}]'
            items = None
        elif isinstance(event, yaml.ScalarEvent):
            if items is None:
                name = event.value
            else:
                items.append(event.value if event.implicit[0] else '')   # quoted is no number


def _headings(text: str) -> Iterator[str]:
    """Yield the names of nodes that the parameters of a file are for, as paths."""
    path, pending, depth = [], None, 0   # open keys above any ros__parameters; the key read last; mappings within
    for event in _events(text):
        if isinstance(event, yaml.MappingStartEvent):
            if depth or pending == 'ros__parameters':
                if not depth:
                    yield '/' + '/'.join(part.strip('/') for part in path[1:])
                depth += 1
            else:
                path.append(pending or '')
            pending = None
        elif isinstance(event, yaml.MappingEndEvent):
            if depth:
                depth -= 1
            else:
                path.pop()
        elif isinstance(event, yaml.ScalarEvent) and not depth:
            pending = event.value


def _matches(heading: str, full_name: str) -> bool:
    """Tell whether ROS takes parameters under this heading for the node of this name: ** is any path, * one part."""
    parts = ['' if part == '' else '(/\\w+)*' if part == '**' else '/\\w+' if part == '*' else '/' + re.escape(part)
             for part in heading.split('/')]
    return re.fullmatch(''.join(parts), full_name) is not None
