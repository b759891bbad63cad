"""A chain's equations of motion as Unicode text for a terminal of 80 columns."""
from __future__ import annotations

from dataclasses import replace
from typing import Iterable, Optional, Sequence

import numpy as np

from .equations import Equations
from .factors import Symbol
from .notation import display_width, SOFT_BREAK, TEXT
from .terms import Equation
from .topology import carried_by, carrier_number, coordinates_by_body, matrices, outer_bodies, vectors_by_angle
from .writing import Writer
from ..mechanics.path_matrix import shared_mass_matrix

WIDTH = 80
NOTHING = '\u00b7'     # an entry of a matrix that is zero
WRITER = Writer(TEXT)


def text_document(equations: Equations, chosen: Optional[Sequence[Equation]] = None) -> str:
    """Return bodies, topology and all equations, or the `chosen` equations alone."""
    heading = [] if chosen else [*_title(equations), *_bodies(equations), '', *_topology(equations),
                                 *_unit_vectors(equations), '']
    blocks = ['\n'.join(equation_lines(equation)) for equation in chosen or equations]
    return '\n'.join([*heading, '\n\n'.join(blocks), ''])


def equation_lines(equation: Equation) -> list[str]:
    """Return one equation: a heading, a line for each piece of the left side, the right side."""
    coordinate = equation.coordinate
    lines = heading(equation, f', {coordinate.unit}')
    operator = ' '
    for sign, piece in WRITER.left(equation):
        operator = TEXT.minus if sign < 0 else operator
        lines += wrapped(piece, f'   {operator} ', 9)
        operator = '+'
    right = WRITER.sum_of(WRITER.right(equation))
    return lines + wrapped(right, '   = ', 9)


def heading(equation: Equation, behind: str) -> list[str]:
    """Return number, symbol and joint of an equation, and what stands behind them."""
    coordinate = equation.coordinate
    text = f'{TEXT.coordinate(coordinate)}, {coordinate.joint}{behind}'
    return wrapped(text.replace(' ', SOFT_BREAK), f'({equation.number})  ', 8)


def wrapped(text: str, head: str, indent: int, width: int = WIDTH) -> list[str]:
    """Return text with a head in lines of at most `width` columns where its soft breaks allow it."""
    first, *words = text.split(SOFT_BREAK)
    lines, line = [], head + first
    columns = display_width(line)
    for word in words:
        columns += 1 + display_width(word)
        if columns > width:
            lines.append(line)
            line, columns = ' ' * indent + word, indent + display_width(word)
        else:
            line = f'{line} {word}'
    return [*lines, line]


def _title(equations: Equations) -> list[str]:
    chain = equations.chain
    kind = 'absolute angles' if equations.coordinates == 'absolute' else 'joint coordinates'
    title = f'{chain.name}: equations of motion in {kind}'
    return [title, '=' * min(display_width(title), WIDTH), '']


def _value(symbol: Symbol) -> str:
    unit = symbol.unit.replace('^2', '\u00b2').replace(' ', '\u00a0')
    return f'{TEXT.symbol(symbol)}\u00a0=\u00a0{TEXT.number(symbol.value)}\u00a0{unit}'


def _flow(items: Iterable[str], indent: int, separator: str = ',') -> list[str]:
    """Items side by side; the spaces inside an item are not to be broken."""
    text = (separator + SOFT_BREAK).join(items)
    return [line.replace('\u00a0', ' ') for line in wrapped(text, ' ' * indent, indent)] if text else []


def _bodies(equations: Equations) -> list[str]:
    """Each body with its carrier, its coordinates and, where symbols are printed, their values."""
    chain, coordinates = equations.chain, coordinates_by_body(equations.unknowns)
    number_width, lines = len(str(len(chain.bodies))), ['Bodies']
    masses, symbols = np.diag(shared_mass_matrix(chain)), equations.symbols().values()
    for i, body in enumerate(chain.bodies):
        carrier = carrier_number(chain, i)
        moves = [f'{"slides" if c.letter == "x" else "turns"}\u00a0{TEXT.coordinate(c)}\u00a0({c.joint})'
                 for c in coordinates.get(i + 1, [])] or ['welded']
        place = f'{carrier}\u00a0{chain.bodies[body.carrier].name}' if carrier else 'the base'
        text = f'{body.name}, on {place}: {", ".join(moves)}'.replace(' ', SOFT_BREAK)
        lines += [line.replace('\u00a0', ' ') for line in wrapped(text, f'{i + 1:{number_width + 1}}  ', 7)]
        lines += _flow([_outboard_mass(symbol, equations, masses) if symbol.letter == 'M' else _value(symbol)
                        for symbol in symbols if symbol.index == i + 1], 7)
    gravity = [_value(symbol) for symbol in symbols if not symbol.index]
    return lines + (_flow(['gravity\u00a0' + gravity[0], *gravity[1:]], 2) if gravity else [])


def _outboard_mass(total: Symbol, equations: Equations, masses: np.ndarray) -> str:
    """M_i as the sum it is (5.60)."""
    i = total.index - 1
    own = [replace(total, letter='m')] if equations.chain.bodies[i].mass else []
    parts = own + [replace(total, index=k + 1) for k in carried_by(equations.chain, i) if masses[k]]
    return f'{TEXT.symbol(total)} = {" + ".join(map(TEXT.symbol, parts))} = {TEXT.number(total.value)} kg'.replace(
        ' ', '\u00a0')


def _topology(equations: Equations) -> list[str]:
    """S, S_, P and M = P m P^T; zeros are dots."""
    chain = equations.chain
    blocks = []
    for name, matrix in matrices(chain).items():
        cells = [[TEXT.number(entry) if entry else NOTHING for entry in row] for row in matrix.tolist()]
        blocks.append(matrix_block(name, cells))
    if equations.numeric:
        cells = [[TEXT.number(entry) if entry else NOTHING for entry in row]
                 for row in shared_mass_matrix(chain).tolist()]
    else:
        cells = [[TEXT.symbol(Symbol('M', entry, 0.0)) if entry else NOTHING for entry in row]
                 for row in outer_bodies(chain).tolist()]
    blocks.append(matrix_block('M = P m P\u1d40' + (', kg' if equations.numeric else ''), cells))
    return ['Topology', *side_by_side(blocks)]


def matrix_block(name: str, cells: Sequence[Sequence[str]]) -> list[str]:
    """Return a matrix under its name; one that is too wide goes on below, as columns k to l."""
    count = len(cells)
    width = max(display_width(cell) for row in cells for cell in row)
    parts = -(-count // max(1, (WIDTH - 1) // (width + 1)))
    columns = -(-count // parts)
    lines = []
    for first in range(0, count, columns):
        last = min(first + columns, count)
        part = '' if count <= columns else f', columns {first + 1} to {last}'
        rows = [' '.join(' ' * (width - display_width(cell)) + cell for cell in row[first:last]) for row in cells]
        lines += ([''] if lines else []) + [f'  {name}{part}', *(f'  {row}' for row in rows)]
    return lines


def side_by_side(blocks: Sequence[list[str]]) -> list[str]:
    """Return blocks of lines beside one another where the width allows it, else below."""
    lines: list[str] = []
    beside: Optional[list[str]] = None
    for block in blocks:
        width = max(map(display_width, beside)) + 2 if beside else 0
        if beside and len(beside) == len(block) and width + max(map(display_width, block)) <= WIDTH:
            beside = [f'{one}{" " * (width - display_width(one))}{other}' for one, other in zip(beside, block)]
        else:
            lines += [*beside, ''] if beside else []
            beside = block
    return [*lines, *(beside or [])]


def _unit_vectors(equations: Equations) -> list[str]:
    """Which way the vectors in the scalar products point."""
    items = []
    for row in vectors_by_angle(equations):
        names = ' '.join(TEXT.vector(replace(vector, turned=False)) for vector in row)
        offsets = [(1, replace(offset, letter='') if equations.numeric else offset) for offset in row[0].offsets]
        length = f' = {TEXT.number(row[0].length.value)} m/s\u00b2' if row[0].length and equations.numeric else ''
        items.append(f'{names}{length} at {WRITER.angle(row[0].parts, offsets)}'.replace(' ', '\u00a0'))
    if not items:
        return []
    return ['', 'Unit vectors; \u00e2, b\u0302, \u00fb are r\u0302, \u03c7, \u0109 turned by +90\u00b0',
            *_flow(items, 2, ';')]
