"""
YAML text <-> plain data: the only file that knows YAML.

Scalars follow YAML 1.2's core rules, so `1e-3` is a number and `yes` is a string. Anchors, aliases, tags and keys given
twice are refused, nesting is bounded, and a text of any size or content ends in data or in one ChainError sentence.
"""
from __future__ import annotations

import re
from typing import Any

import yaml
from yaml import events

from .section import clipped, LinedDict, MAX_DEPTH, MAX_ITEMS, MAX_KEYS
from ..errors import ChainError

LOADER: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
DUMPER: Any = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)
MAX_BYTES = 16 * 2**20
UNPRINTABLE = re.compile('[^\t\n\r -~\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]')   # YAML 1.2, rule [1]
TAB = re.compile(' *\t')
INTEGER = re.compile('[-+]?[0-9]{1,20}|0o[0-7]{1,20}|0x[0-9a-fA-F]{1,20}')
NUMBER = re.compile(r'[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?')
CONSTANTS = {'': None, '~': None, 'null': None, 'Null': None, 'NULL': None,
             'true': True, 'True': True, 'TRUE': True, 'false': False, 'False': False, 'FALSE': False,
             **{sign + word: float(sign + 'inf') for sign in ('', '+', '-') for word in ('.inf', '.Inf', '.INF')},
             **{word: float('nan') for word in ('.nan', '.NaN', '.NAN')}}


def data_from_text(text: str, name: str) -> LinedDict:
    """Return the mapping that a YAML text is; ChainError, in which `name` stands for the text."""
    refuse_unprintable(text, name)
    return Composer(name).compose(text)


def refuse_unprintable(text: str, name: str) -> None:
    """Raise ChainError for the first character that YAML does not allow."""
    strange = UNPRINTABLE.search(text)
    if strange:
        line = text.count('\n', 0, strange.start()) + 1
        raise ChainError(f'{name} line {line}: holds the character {strange.group()!r}, must be printable text')


def decoded(data: bytes, name: str) -> str:
    """Return UTF-8 text, with a byte order mark or without; ChainError names another encoding or format."""
    begin = data[:64]
    every_second_is_zero = len(begin) > 3 and any(begin) and not (any(begin[::2]) and any(begin[1::2]))
    if begin[:2] in (b'\xff\xfe', b'\xfe\xff') or every_second_is_zero:
        raise ChainError(f'{name}: is UTF-16 or UTF-32 text, must be UTF-8, in which an editor can save it')
    if b'\0' in data:
        raise ChainError(f'{name}: is a binary file, must be a chain file in YAML')
    try:
        return data.decode('utf-8-sig')
    except UnicodeDecodeError as error:
        if data.lstrip().startswith(b'<'):   # XML of another encoding: what matters in a robot's file is ASCII
            return data.decode('cp1252', 'replace')
        line = data.count(b'\n', 0, error.start) + 1
        raise ChainError(f'{name} line {line}: is not UTF-8 text, must be a chain file in YAML') from None


def text_of(data) -> str:
    """Return plain data as a YAML text that loads back to the same bits."""
    return yaml.dump(data, Dumper=PlainDumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=99)


class Composer:
    """YAML events -> mappings with lines, lists and scalars; a stack of open containers instead of recursion."""

    def __init__(self, name: str):
        """Start with nothing open; `name` stands for the text in sentences."""
        self.name = name
        self.root = None
        self.open = []       # containers that are being filled, outermost first
        self.key = None      # of the innermost mapping, while it waits for its value

    def fail(self, line, problem):
        """Raise the ChainError sentence for a line, with the body's name where one is known (root, bodies, body)."""
        body = self.open[2].get('name') if len(self.open) > 2 and isinstance(self.open[2], dict) else None
        label = f"body '{clipped(body)}' " if isinstance(body, str) else ''
        raise ChainError(f'{self.name} line {line}: {label}{problem}')

    def compose(self, text) -> LinedDict:
        """Return the mapping that the text is."""
        loader, documents = LOADER(text), 0
        try:
            while (event := loader.get_event()) is not None:
                if isinstance(event, events.NodeEvent):
                    self.take(event, event.start_mark.line + 1)
                elif isinstance(event, events.CollectionEndEvent):
                    self.open.pop()
                elif isinstance(event, events.DocumentStartEvent):
                    documents += 1
                    if documents > 1:
                        self.fail(event.start_mark.line + 1, 'starts a second YAML document, must be one')
        except yaml.YAMLError as error:
            mark = getattr(error, 'problem_mark', None)
            line = f' line {mark.line + 1}' if mark else ''
            if mark and TAB.match(''.join(text.split('\n')[mark.line:mark.line + 1])):
                raise ChainError(f'{self.name}{line}: is indented with a tab, must be indented with spaces') from None
            problem = clipped(getattr(error, 'problem', None) or getattr(error, 'reason', 'unreadable'), 120)
            raise ChainError(f'{self.name}{line}: is not valid YAML ({problem}), must be a chain file') from None
        finally:
            loader.dispose()
        if self.root is None:
            raise ChainError(f"{self.name}: is empty, must be a mapping with the key 'bodies'")
        return self.root

    def take(self, event, line):
        """Put one node, a key or a value, where it belongs."""
        if event.anchor is not None:
            self.fail(line, f"has the anchor or alias '{clipped(event.anchor)}', must be written out in full")
        if event.tag is not None:
            tag = clipped(event.tag.replace('tag:yaml.org,2002:', '!!'))
            self.fail(line, f"has the tag '{tag}', must be plain YAML without tags")
        scalar = isinstance(event, events.ScalarEvent)
        if self.key is None and self.open and isinstance(self.open[-1], dict):
            if not scalar:
                self.fail(line, 'has a list or mapping as a key, must be a string')
            self.take_key(event.value, line)
        elif scalar:
            self.put(plain_scalar(event.value) if event.implicit[0] else event.value, line)
        else:
            container = LinedDict(line) if isinstance(event, events.MappingStartEvent) else []
            self.put(container, line)
            if len(self.open) == MAX_DEPTH:
                self.fail(line, f'is nested deeper than {MAX_DEPTH} levels, must be a chain file')
            self.open.append(container)

    def take_key(self, key, line):
        """Note the key of the innermost mapping whose value comes next."""
        lines = self.open[-1].lines
        if key in lines:
            self.fail(line, f"key '{clipped(key)}' is given twice, on line {lines[key]} too, must be given once")
        if len(lines) == MAX_KEYS:
            self.fail(line, f"key '{clipped(key)}' is one too many, must be one of at most {MAX_KEYS} in a mapping")
        lines[key] = line
        self.key = key

    def put(self, value, line):
        """Put a value into the innermost container, or take it as the root."""
        if not self.open:
            if not isinstance(value, dict) and value is not None:
                got = 'a list' if isinstance(value, list) else 'a single value'
                self.fail(line, f"is {got}, must be a mapping with the key 'bodies'")
            self.root = value
        elif self.key is not None:
            self.open[-1][self.key] = value
            self.key = None
        elif len(self.open[-1]) == MAX_ITEMS:
            self.fail(line, f'has one item too many, must be a list of at most {MAX_ITEMS}')
        else:
            self.open[-1].append(value)


def plain_scalar(text):
    """Return the value of an unquoted scalar by YAML 1.2's core rules: None, a truth value, a number or a string."""
    if text in CONSTANTS:
        return CONSTANTS[text]
    if text[0] in '+-.0123456789':
        if INTEGER.fullmatch(text):
            return int(text, 0 if text[1:2] in ('o', 'x') else 10)
        if NUMBER.fullmatch(text):
            return float(text)
    return text


class PlainDumper(DUMPER):
    """A YAML writer whose strings are read as strings by YAML 1.2's rules, too, and that writes no anchors."""

    def ignore_aliases(self, data):
        """Write shared values in full."""
        return True

    def represent_text(self, text):
        """Quote a string that would be read as something else."""
        style = None if isinstance(text, str) and plain_scalar(text) == text else "'"
        return self.represent_scalar('tag:yaml.org,2002:str', text, style=style)


PlainDumper.add_representer(str, PlainDumper.represent_text)
