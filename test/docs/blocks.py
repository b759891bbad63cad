"""The blocks of the documents: the text between two fences, its language, and whether it is to be run."""
from importlib.util import find_spec
from pathlib import Path
import re
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', ROOT / 'CHANGELOG.md', ROOT / 'examples/README.md',
         *sorted((ROOT / 'docs').glob('*.md'))]
LANGUAGES = ('bash', 'python', 'yaml', 'text', 'math')
FENCE = re.compile(r' *```(.*)')
UNTESTED = re.compile(r'(\w+) untested: (.+)')
NEEDS = re.compile(r'(\w+) needs (\w+)')     # a Python package; the block is run where that is installed
MISSING = 'a package is missing'
FILE = re.compile(r'# ([\w.]+\.(?:yaml|py|csv))\n')
TERMINAL = re.compile(r'# terminal (\d)')


class Block(NamedTuple):
    """A block of a page: its first line's number, language, text, and why it is not run, if it is not."""

    page: Path
    line: int
    language: str
    text: str
    untested: str = ''

    @property
    def file(self) -> str:
        """The name of the file that the block is, '' if it is none."""
        named = FILE.match(self.text) if self.language in ('yaml', 'python', 'text') else None
        return named.group(1) if named else ''

    @property
    def commands(self) -> list:
        """(terminal, command) of a bash block; terminal 0 where none is named. Continued lines are joined."""
        found, terminal = [], 0
        for line in self.text.replace('\\\n', ' ').splitlines():
            named = TERMINAL.fullmatch(line.strip())
            if named:
                terminal = int(named.group(1))
            elif line.strip() and not line.lstrip().startswith('#'):
                found.append((terminal, line.strip()))
        return found

    def __str__(self):
        return f'{self.page.name}, line {self.line}'


def blocks_of(page: Path) -> list:
    """Return the blocks of a page; ValueError: a fence without a known language, or one that is not closed."""
    blocks, opened, taken = [], None, []
    for number, line in enumerate(page.read_text().splitlines(), 1):
        fence = FENCE.fullmatch(line)
        if opened is None and fence:
            opened, taken = (number, fence.group(1).strip()), []
        elif fence and not fence.group(1).strip():
            blocks.append(_block(page, *opened, '\n'.join(taken) + '\n'))
            opened = None
        elif opened is not None:
            taken.append(line)
    if opened is not None:
        raise ValueError(f'{page.name}, line {opened[0]}: the fence is not closed')
    return blocks


def _block(page: Path, line: int, info: str, text: str) -> Block:
    marked, needing = UNTESTED.fullmatch(info), NEEDS.fullmatch(info)
    language, reason = marked.groups() if marked else (info, '')
    if needing:
        language, package = needing.groups()
        reason = '' if find_spec(package) else MISSING
    if language not in LANGUAGES:
        raise ValueError(f'{page.name}, line {line}: the fence says {info!r}, must say {", ".join(LANGUAGES)}, and '
                         '`untested: reason` behind it if the block is not run')
    return Block(page, line, language, text, reason)
