"""
One mapping of a chain file, read key by key: every refusal is one ChainError sentence.

A sentence says where, which body, which key, what was given and what is wanted. Data from a text has its line numbers
(`LinedDict`); other data is named by its path, `bodies[2].rotation.damping`.
"""
from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite, pi, radians
from numbers import Integral, Real
import re
from typing import NoReturn, Optional

from ..errors import ChainError

MAX_DEPTH = 32       # of nested mappings and lists
MAX_KEYS = 256       # of one mapping
MAX_ITEMS = 65536    # of one list
MISSING = object()
FACTOR = r'(pi|\d+\.?\d*(?:e[-+]?\d+)?|\.\d+(?:e[-+]?\d+)?)'
ANGLE = re.compile(rf'([-+]?) *{FACTOR}((?: *[*/] *{FACTOR})*) *((?:deg|rad)(?:/s)?)?', re.ASCII)
ANGLE_TEXTS = "or a string such as '90 deg', 'pi/2', '-0.5*pi'"


class LinedDict(dict):
    """A mapping from a text: `line` is where it starts, `lines` where each of its keys stands (from 1)."""

    __slots__ = ('line', 'lines')

    def __init__(self, line):
        """Start empty, on the given line of the text."""
        self.line = line
        self.lines = {}


class Section:
    """One mapping of a chain file while it is read; its errors say where it is."""

    __slots__ = ('data', 'file', 'path', 'label', 'prefix')

    def __init__(self, data, file, path='', label='', prefix=''):
        """Wrap `data`, which `file` holds at `path`; sentences call it `label` and its keys `prefix` + key."""
        self.data, self.file, self.path, self.label, self.prefix = data, file, path, label, prefix

    def fail(self, key, problem) -> NoReturn:
        """Raise the ChainError sentence for one key."""
        if isinstance(self.data, LinedDict):
            where = f'{self.file} line {self.data.lines.get(key, self.data.line)}'
        else:
            where = f'{self.path}.{clipped(key)}'.lstrip('.')
        raise ChainError(f"{where}: {self.label}key '{self.prefix}{clipped(key)}' {problem}")

    def refuse_unknown_keys(self, known, elsewhere=(), place=''):
        """Raise for the first key that is not `known`; the sentence has a similar known key, or the right place."""
        for key in self.data:
            if key in known:
                continue
            if key in elsewhere:
                self.fail(key, f'is unknown here, must stand {place}')
            self.fail(key, f'is unknown{suggestion(key, known)}, must be one of {", ".join(known)}')

    def number(self, key, default=None, unit='', least=None, wanted='') -> float:
        """
        Return the number under `key`; without a default the key is required.

        A default that is infinite may also be given. A `unit` of angles or their rates allows texts such as '90 deg'.
        """
        value = self.data.get(key, MISSING)
        if value is MISSING and default is not None:
            return default
        angle = isinstance(value, str) and unit.startswith('rad')
        number = angle_of(value, unit.startswith('rad/s')) if angle else as_number(value)
        if number is not None and (isfinite(number) or number == default) and (least is None or number >= least):
            return number
        finite = 'finite ' if number is not None and not isfinite(number) else ''
        bound = '' if least is None else f' >= {least:g}'
        endless = f' or {"-" * (default < 0)}.inf' if finite and default in (inf, -inf) else ''
        wanted = wanted or f'a {finite}number{bound}{endless} ({unit})'
        self.fail(key, f'is {shown(value)}, must be {wanted}{f", {ANGLE_TEXTS}" if angle else ""}')

    def vector(self, key, default, unit) -> complex:
        """Return the plane vector x + j y under `key`, a list of two numbers."""
        value = self.data.get(key, MISSING)
        if value is MISSING:
            return default
        if isinstance(value, list) and len(value) == 2:
            x, y = as_number(value[0]), as_number(value[1])
            if x is not None and y is not None and isfinite(x) and isfinite(y):
                return complex(x, y)
        self.fail(key, f'is {shown(value)}, must be a list of two finite numbers [x, y] ({unit})')

    def text(self, key, default=None, wanted='a string') -> str:
        """Return the non-empty, printable text under `key`; without a default the key is required."""
        value = self.data.get(key, MISSING)
        if value is MISSING and default is not None:
            return default
        if isinstance(value, str) and value and value.isprintable():
            return value
        how = (' (in quotes if it looks like a number)' if isinstance(value, (int, float)) else
               ' of printable characters' if isinstance(value, str) and value else '')
        self.fail(key, f'is {shown(value)}, must be {wanted}{how}')

    def section(self, key) -> Optional[Section]:
        """Return the mapping under `key` as a section of its own, None where the key is absent."""
        value = self.data.get(key, MISSING)
        if value is MISSING:
            return None
        if not isinstance(value, dict):
            self.fail(key, f'is {shown(value)}, must be a mapping')
        return Section(value, self.file, f'{self.path}.{key}', self.label, f'{self.prefix}{key}.')


def as_number(value) -> Optional[float]:
    """Return a plain number as float, None for anything else, truth values included."""
    return float(value) if type(value) in (float, int) else None


def angle_of(text: str, rate: bool = False) -> Optional[float]:
    """
    Return the angle, rad, or rate, rad/s, of a string: a number of `deg` or `rad`, or a product with pi; else None.

    Factors are multiplied and divided from left to right, as Python would.
    """
    match = ANGLE.fullmatch(text.strip().lower()) if len(text) <= 64 else None
    if not match:
        return None
    sign, first, others, _, unit = match.groups()
    unit = unit or ''
    if ('pi' in first + others) == bool(unit) or (unit.endswith('/s') and not rate):
        return None
    value = pi if first == 'pi' else float(first)
    for operator, factor in re.findall(rf'([*/]) *{FACTOR}', others):
        factor = pi if factor == 'pi' else float(factor)
        if operator == '/' and factor == 0.0:
            return None
        value = value * factor if operator == '*' else value / factor
    value = radians(value) if unit.startswith('deg') else value
    return -value if sign == '-' else value


def clipped(text, length=48) -> str:
    """Return `text` on one line and short enough for a sentence."""
    text = text if len(text) <= length else text[:length] + '...'
    return text if text.isprintable() else repr(text)[1:-1]


def counted(number: int, noun: str) -> str:
    """Return a number of things, as in '1 link' and '2 links'."""
    return f'{number} {noun}' if number == 1 else f'{number} {noun}s'


def shown(value) -> str:
    """Return how a sentence names a given value."""
    if value is MISSING:
        return 'missing'
    if value is None:
        return 'empty'
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, str):
        return f"'{clipped(value)}'"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, dict):
        return 'a mapping'
    if len(value) <= 3 and not any(isinstance(item, (list, dict)) for item in value):
        return f'[{", ".join(map(shown, value))}]'
    return f'a list of {len(value)}'


def suggestion(word, known) -> str:
    """Return ' (did you mean ...?)' where one of the known words is close to `word`, '' otherwise."""
    from difflib import get_close_matches
    close = get_close_matches(word.lower(), known, n=1) if len(word) <= 64 else []
    return f" (did you mean '{clipped(close[0])}'?)" if close else ''


def plain_text(text, path) -> str:
    """Return a copy of `text` as a plain str; ChainError: no file can hold it."""
    if not text.isascii() and re.search('[\ud800-\udfff]', text):
        raise ChainError(f'{path or "the chain"}: holds the text {clipped(text)!a}, must be printable text')
    return str(text)


def plain(value, path='', depth=0):
    """Return a copy of `value` in plain dicts, lists, texts and numbers; numpy values and tuples are taken too."""
    if not isinstance(value, (str, Real, Mapping, list, tuple)) and hasattr(value, 'tolist'):
        value = value.tolist()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, Integral) and int(value).bit_length() <= 64:
        return int(value)
    if isinstance(value, Real):
        try:
            return float(value)
        except OverflowError:
            return inf if value > 0 else -inf   # type: ignore[operator]
    if isinstance(value, str):
        return plain_text(value, path)
    wanted = 'a mapping, a list, a string or a number'
    if not isinstance(value, (Mapping, list, tuple)):
        raise ChainError(f'{path or "the chain"}: is of type {type(value).__name__}, must be {wanted}')
    if depth == MAX_DEPTH:
        raise ChainError(f'{path[:60]}...: is nested deeper than {MAX_DEPTH} levels, must be a chain')
    if len(value) > (MAX_KEYS if isinstance(value, Mapping) else MAX_ITEMS):
        raise ChainError(f'{path}: has {len(value)} entries, must have at most {MAX_KEYS} keys or {MAX_ITEMS} items')
    if isinstance(value, Mapping):
        odd = [type(key).__name__ for key in value if not isinstance(key, str)]
        if odd:
            place = path or 'the chain'
            raise ChainError(f'{place}: has a key of type {odd[0]}, must be a mapping whose keys are strings')
        keys = [plain_text(key, path) for key in value]
        return {key: plain(item, f'{path}.{clipped(key)}'.lstrip('.'), depth + 1)
                for key, item in zip(keys, value.values())}
    return [plain(item, f'{path}[{i}]', depth + 1) for i, item in enumerate(value)]
