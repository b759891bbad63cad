"""A table as text: columns aligned, numbers to the right, no line longer than WIDTH."""
from __future__ import annotations

from itertools import zip_longest
from textwrap import wrap
from typing import Iterator, Sequence

WIDTH = 100
GAP = 2   # blanks between columns


def shown(value) -> str:
    """Return a cell's text."""
    return f'{value:.4g}' if isinstance(value, float) else '' if value is None else str(value)


def table_lines(columns: Sequence[str], rows: Sequence[Sequence], width: int = WIDTH) -> Iterator[str]:
    """Yield the lines of a table; what is too long for its column goes on in the next line."""
    cells = [list(map(shown, row)) for row in rows]
    widths = _widths(columns, cells, width)
    right = [all(isinstance(row[k], (int, float)) or row[k] is None for row in rows) for k in range(len(columns))]
    for line in (columns, ['-' * size for size in widths], *cells):
        yield from _aligned(line, widths, right)


def _widths(columns: Sequence[str], cells: list, width: int) -> list:
    """Return how wide the columns are: as their longest cell, or what is left; words of cells break last."""
    body = [[row[k] for row in cells] for k in range(len(columns))]
    in_body, in_heads = ([max([1, *(len(part) for text in texts for part in text.split())]) for texts in column]
                         for column in (body, [[column] for column in columns]))
    longest = list(map(max, in_body, in_heads))
    widths = [max(size, *map(len, texts), 1) for size, texts in zip(longest, body)]
    for least in (longest, in_body, [1] * len(columns)):
        while sum(widths) > width - GAP * (len(columns) - 1) and any(map(int.__gt__, widths, least)):
            narrowed = max((k for k in range(len(columns)) if widths[k] > least[k]), key=widths.__getitem__)
            widths[narrowed] -= 1
    return widths


def _aligned(line: Sequence[str], widths: list, right: list) -> Iterator[str]:
    for parts in zip_longest(*(wrap(cell, size) or [''] for cell, size in zip(line, widths)), fillvalue=''):
        yield (GAP * ' ').join(part.rjust(size) if to_right else part.ljust(size)
                               for part, size, to_right in zip(parts, widths, right)).rstrip()
