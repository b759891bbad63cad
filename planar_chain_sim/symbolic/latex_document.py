"""A chain's equations of motion in LaTeX, for a paper."""
from __future__ import annotations

from dataclasses import replace
from typing import Optional, Sequence

from .equations import Equations
from .factors import Symbol
from .notation import LATEX, SOFT_BREAK
from .terms import Equation
from .topology import matrices, outer_bodies, vectors_by_angle
from .writing import Writer
from ..mechanics.path_matrix import shared_mass_matrix

WIDE = 12      # columns of a matrix; one that is wider is made to fit the page
WIDTH = 88     # characters, as they are set, of a line of an equation
WRITER = Writer(LATEX)


def latex_document(equations: Equations, chosen: Optional[Sequence[Equation]] = None) -> str:
    r"""Return topology, symbols and all equations, or the `chosen` ones; the first line says what they need."""
    parts = [f'% {equations.chain.name}: equations of motion; they need '
             r'\usepackage{amsmath,graphicx,longtable}, long ones \allowdisplaybreaks']
    if not chosen:
        parts += [*_topology(equations), *_symbols(equations), *_unit_vectors(equations)]
    for equation in chosen or equations:
        coordinate = equation.coordinate
        rows = [rf'& \hspace{{{indent}em}} {row}' if indent else f'& {row}'
                for indent, row in equation_rows(equation)]
        parts += [f'% ({equation.number}) for {coordinate}, joint {coordinate.joint}, in {coordinate.unit}',
                  r'\begin{align*}', *(f'{row} \\\\' for row in rows[:-1]), rows[-1], r'\end{align*}']
    return '\n'.join(parts) + '\n'


def equation_rows(equation: Equation) -> list[tuple[int, str]]:
    """Return an equation in rows of at most WIDTH set characters with their indents, em; the right side begins one."""
    rows: list[str] = []
    for sign, piece in WRITER.left(equation):
        operator = f'{LATEX.minus} ' if sign < 0 else '+ ' if rows else ''
        piece = operator + piece
        if rows and LATEX.width(f'{rows[-1]} {piece}'.replace(SOFT_BREAK, ' ')) <= WIDTH:
            rows[-1] += f' {piece}'
        else:
            rows.append(piece)
    right = '= ' + WRITER.sum_of(WRITER.right(equation))
    return [*wrapped(rows[0], 0), *(part for row in rows[1:] for part in wrapped(row, 1)), *wrapped(right, 1)]


def wrapped(text: str, indent: int) -> list[tuple[int, str]]:
    """Return text in rows of at most WIDTH set characters where its soft breaks allow it."""
    rows, row = [], ''
    for word in text.split(SOFT_BREAK):
        if row and LATEX.width(f'{row} {word}') > WIDTH:
            rows.append((3 if rows else indent, row))
            row = word
        else:
            row = f'{row} {word}' if row else word
    return [*rows, (3 if rows else indent, row)]


def _topology(equations: Equations) -> list[str]:
    chain = equations.chain
    named = {**{name.replace('_', '_{-}'): [[str(entry) if entry else '' for entry in row] for row in matrix.tolist()]
                for name, matrix in matrices(chain).items()}}
    if equations.numeric:
        masses = [[LATEX.number(entry) if entry else '' for entry in row] for row in shared_mass_matrix(chain).tolist()]
    else:
        masses = [[LATEX.symbol(Symbol('M', entry, 0.0)) if entry else '' for entry in row]
                  for row in outer_bodies(chain).tolist()]
    named[r'M = P m P^{T}'] = masses
    lines = []
    for name, rows in named.items():
        matrix = [f'{name} = \\left(\\begin{{array}}{{*{{{len(rows)}}}{{c}}}}',
                  *(f'{" & ".join(row)} \\\\' for row in rows), r'\end{array}\right)']
        if len(rows) > WIDE:
            matrix = [rf'\resizebox{{\linewidth}}{{!}}{{${matrix[0]}', *matrix[1:-1], f'{matrix[-1]}$}}']
        lines += [r'\[', *matrix, r'\]']
    return lines


def _symbols(equations: Equations) -> list[str]:
    rows = []
    for symbol in sorted(equations.symbols().values(), key=lambda symbol: symbol.index):
        unit = symbol.unit.replace('^2', '$^{2}$')
        rows.append(f'${LATEX.symbol(symbol)}$ & ${LATEX.number(symbol.value)}$ & {unit} & '
                    f'{LATEX.name(symbol.meaning)} \\\\')
    return ['', r'\begin{longtable}{lrll}', *rows, r'\end{longtable}', ''] if rows else []


def _unit_vectors(equations: Equations) -> list[str]:
    items = []
    for row in vectors_by_angle(equations):
        names = ', '.join(LATEX.vector(replace(vector, turned=False)) for vector in row)
        offsets = [(1, replace(offset, letter='') if equations.numeric else offset) for offset in row[0].offsets]
        items.append(f'${names}$ at ${WRITER.angle(row[0].parts, offsets)}$')
    if not items:
        return []
    return [r'Unit vectors ($\hat{a}$, $\hat{b}$, $\hat{u}$ are $\hat{r}$, $\chi$, $\hat{c}$ turned by $+90^{\circ}$):',
            ';\n'.join(items) + '.', '']
