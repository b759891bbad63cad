"""
Joint efforts from a command line or a file: one constant row, a row per tick, or rows with a starting time.

A text file may have a header with the names of joints in any order and a time column. Commas, semicolons, tabs or
spaces separate its columns. Lines without a value, and those that begin with #, are skipped.
"""
from __future__ import annotations

from math import ceil, isfinite
from pathlib import Path
import re
from typing import Any, NamedTuple, Optional, Union

import numpy as np

from ..chain.chain import Chain
from ..chain.joint_arrays import joint_array
from ..chain.section import angle_of, clipped, counted, suggestion
from ..errors import Mistake

TIME = re.compile(r'(time|t)(_s|\s*[\[(]s[\])])?', re.IGNORECASE)   # the name of a column
SEPARATORS = (';', '\t', ',', None)   # the first that the first row has; None: blanks
EMPTY = ' \t\r\n,;"\''   # of which a spreadsheet's empty row consists
GRID = 1e-6   # ticks: a time this little after a tick counts as at the tick


class Efforts(NamedTuple):
    """Efforts `rows` (rows, joints), N m or N; `time` (rows,), s, from which each acts; None: a row per tick."""

    rows: np.ndarray
    time: Optional[np.ndarray] = None

    def ticks(self, step: float) -> int:
        """Return the number of ticks that the rows cover."""
        return len(self.rows) if self.time is None else self._first_ticks(step)[-1] + 1

    def by_tick(self, ticks: int, step: float, name: str) -> np.ndarray:
        """Return a row for each tick (ticks, joints), zero before the first time; Mistake: rows that do not fit."""
        if self.time is None:
            if len(self.rows) < ticks:
                raise Mistake(f'{name} has {counted(len(self.rows), "row")}, must have one for each of the {ticks} '
                              'ticks')
            return self.rows[:ticks]
        first = self._first_ticks(step)
        if first[0] >= ticks:
            raise Mistake(f'{name} begins at {self.time[0]:g} s, must begin before the end at {ticks * step:g} s')
        row = np.searchsorted(first, np.arange(ticks), side='right')   # number of rows that have begun
        return np.vstack((np.zeros_like(self.rows[:1]), self.rows))[row]

    def _first_ticks(self, step: float) -> list:
        times = [] if self.time is None else self.time.tolist()
        return [ceil(min(time / step, 2.0**60) - GRID) for time in times]


def read_efforts(text: str, chain: Chain):
    """
    Return constant efforts (joints,) for '1,0,-2' or 'elbow=1', else the Efforts of a file; Mistake says what is wrong.

    A joint that is not named has no effort.
    """
    name = f'--effort {clipped(text, 200)!r}'
    constant = by_joint(text, name, chain, np.zeros(chain.joint_count), units=('N', 'N m'))
    if constant is not None:
        return constant
    path = Path(text)
    if path.suffix == '.npy':
        return _from_array(path, name, chain)
    return _from_text(path, name, chain)


def by_joint(text: str, name: str, chain: Chain, otherwise: np.ndarray, units: tuple,
             angles: bool = False) -> Optional[np.ndarray]:
    """
    Return numbers (joints,) from '1,2,3' in joint order, or from 'elbow=1,wrist=2' with the rest `otherwise`.

    `units`: of a slide and of a rotation. With `angles` a rotation may have a text as '90 deg'. None for a text that
    is neither; Mistake where it is one and does not fit.
    """
    fields = [field.strip() for field in text.split(',')]
    named = '=' in text
    if not named and not all(_number(field) is not None or (angles and angle_of(field, True) is not None)
                             for field in fields):
        return None
    joints = chain.joint_names
    if not named and len(fields) != len(joints):
        raise Mistake(f'{name} has shape ({len(fields)},), must have ({len(joints)},): one number for each of '
                      f'{clipped(", ".join(joints), 200)}')
    values, given = otherwise.copy(), set()
    for k, field in enumerate(fields):
        joint, _, number = field.rpartition('=') if named else (joints[k], '', field)
        joint = joint.strip()
        if joint not in joints:
            raise Mistake(f'{name} names {clipped(joint)!r}, which is not a joint of {chain.name}'
                          f'{suggestion(joint, joints)}, must be some of {clipped(", ".join(joints), 200)}, each with '
                          '=number')
        if joint in given:
            raise Mistake(f'{name} names {joint!r} twice, must name it once')
        given.add(joint)
        place = joints.index(joint)
        turns = chain.joints[place].kind == 'rotation'
        value = _number(number)
        if value is None and angles and turns:
            value = angle_of(number, True)
        if value is None or not isfinite(value):
            label = joint if named else place
            raise Mistake(f'{name}[{label}] is {clipped(number.strip())}, must be finite, a number in {units[turns]}')
        values[place] = value
    return values


def _number(text: str) -> Optional[float]:
    """Return the number of a text such as 1e-3, inf or nan; None for any other text."""
    if '_' in text or not text.isascii():   # which Python would take
        return None
    try:
        return float(text)
    except ValueError:
        return None


def _from_array(path: Path, name: str, chain: Chain) -> Union[Efforts, np.ndarray]:
    joints = chain.joint_count
    wanted = f'must be an array of numbers with {counted(joints, "column")} and a row per tick'
    try:
        values = np.load(path, allow_pickle=False)
    except OSError as error:
        raise Mistake(f'{name}: cannot be read ({error.strerror or error}), {wanted}') from None
    except (ValueError, EOFError, SyntaxError, OverflowError) as error:   # what a damaged file leads to
        raise Mistake(f'{name}: {clipped(" ".join(str(error).split()), 120)}, {wanted}') from None
    if not isinstance(values, np.ndarray) or values.dtype.kind not in 'fiu' or values.ndim not in (1, 2):
        got = f'{values.dtype} of shape {values.shape}' if isinstance(values, np.ndarray) else 'an archive'
        raise Mistake(f'{name} is {got}, {wanted}')
    shape = (joints,) if values.ndim == 1 else (max(1, len(values)), joints)
    if values.shape != shape:
        raise Mistake(f'{name} has shape {values.shape}, must have {shape}, with a row per tick')
    try:
        rows = joint_array(name, values, shape)
    except ValueError as error:   # a number that is not finite
        raise Mistake(str(error)) from None
    return Efforts(np.atleast_2d(rows)) if values.ndim == 2 else rows


def _from_text(path: Path, name: str, chain: Chain) -> Efforts:
    """Read a table; Mistake names line and column."""
    joints = chain.joint_count
    forms = f'must be {joints} numbers joined by commas, joint=number, or a .csv, .txt or .npy file with a row per tick'
    try:
        with open(path, 'rb') as stream:
            data = stream.read()
    except (OSError, ValueError) as error:   # ValueError: a NUL
        raise Mistake(f'{name}: {getattr(error, "strerror", None) or error}, {forms}') from None
    try:
        if data[:2] in (b'\xff\xfe', b'\xfe\xff'):
            raise UnicodeError
        lines = data.decode('utf-8-sig').splitlines()
    except UnicodeError:
        raise Mistake(f'{name}: is not UTF-8 text, {forms}') from None
    separator, comment, numbers = None, '', []
    columns: Any = None
    for number, line in enumerate(lines, start=1):
        if line.strip(EMPTY)[:1] in ('', '#'):
            comment = line.strip()[1:] if not numbers else comment   # numpy writes a header as a comment
            continue
        where = f'{name} line {number}'
        if columns is None:
            separator = next(mark for mark in SEPARATORS if mark is None or mark in line)
            fields = _split(line, separator)
            header = all(_number(field) is None for field in fields)
            if not header and len(names := _split(comment, separator)) == len(fields) and all(
                    field in chain.joint_names or TIME.fullmatch(field) for field in names):
                columns = _columns(names, f'{where}: the comment before it', chain)
            columns = columns or (_columns(fields, where, chain) if header else _unnamed(fields, where, chain))
            if header:
                continue
        fields = _split(line, separator)
        if len(fields) != len(columns):
            raise Mistake(f'{where} has {counted(len(fields), "column")}, must have {len(columns)} as the lines '
                          'before it')
        row = []
        for column, field in enumerate(fields, start=1):
            value = _number(field)
            if value is None or not isfinite(value):
                what = 'time' if columns[column - 1] is None else chain.joint_names[columns[column - 1]]
                point = ', with a point' if ',' in field else ''
                raise Mistake(f'{where} column {column} ({what}) is {clipped(field)!r}, must be a finite number{point}')
            row.append(value)
        numbers.append((number, row))
    if not numbers:
        raise Mistake(f'{name}: holds no row of numbers, {forms}')
    table = np.array([row for _, row in numbers])
    rows = np.zeros((len(table), joints))
    for column, joint in enumerate(columns):
        if joint is not None:
            rows[:, joint] = table[:, column]
    if None not in columns:
        return Efforts(rows)
    time = table[:, columns.index(None)]
    if time[0] < 0.0 or not (np.diff(time) > 0.0).all():
        k = 0 if time[0] < 0.0 else int(np.argmin(np.diff(time) > 0.0)) + 1
        raise Mistake(f'{name} line {numbers[k][0]} column {columns.index(None) + 1} (time) is {time[k]:g}, must be '
                      f'{"at least 0 s" if k == 0 else f"later than {time[k - 1]:g} s before it"}')
    return Efforts(rows, time)


def _split(line: str, separator: Optional[str]) -> list:
    """Return the columns of a line, without quotes; one empty column at its end is none."""
    fields = [field.strip().strip('"\'').strip() for field in line.strip(' ').split(separator)]
    return fields[:-1] if len(fields) > 1 and not fields[-1] else fields


def _columns(fields: list, where: str, chain: Chain) -> list:
    """Return the joint's index for each column of a header, None for time; Mistake: an unknown name."""
    columns = []
    for column, field in enumerate(fields, start=1):
        if field in chain.joint_names:
            place = chain.joint_names.index(field)
        elif TIME.fullmatch(field):
            place = None
        else:
            raise Mistake(f'{where} column {column} is {clipped(field)!r}, no number and no joint of {chain.name}'
                          f'{suggestion(field, chain.joint_names)}, must be one of time, '
                          f'{clipped(", ".join(chain.joint_names), 200)}')
        if place in columns:
            raise Mistake(f'{where} column {column} is {clipped(field)!r} again, must name another joint')
        columns.append(place)
    if columns == [None]:
        raise Mistake(f'{where} has a time alone, must name joints too')
    return columns


def _unnamed(fields: list, where: str, chain: Chain) -> list:
    """Return the columns of a table without header: the joints in order, after a time where there is one more."""
    joints = chain.joint_count
    if len(fields) not in (joints, joints + 1):
        raise Mistake(f'{where} has {counted(len(fields), "column")}, must have {joints}, or {joints + 1} with '
                      'the time first, or a header with the names of joints')
    return [None] * (len(fields) - joints) + list(range(joints))
