"""What each term of an equation contributes at a state: which terms dominate, and which could be neglected."""
from __future__ import annotations

from typing import NamedTuple

from .equations import Equations
from .factors import State
from .latex_document import WRITER as LATEX_WRITER
from .notation import display_width, LATEX, SOFT_BREAK, TEXT
from .terms import Equation, Term
from .text_document import heading, WRITER as TEXT_WRITER

DIGITS = '{:.6g}'
ROUNDING = 1e-15    # relative to the sum of magnitudes: cos(pi/2) is 6e-17


class Contribution(NamedTuple):
    """A term's value as it stands in its equation, N m or N, and its share in the sum of all magnitudes, 0 to 1."""

    term: Term
    value: float
    share: float


def contributions(equation: Equation, state: State) -> list[Contribution]:
    """Return the terms that are not zero at a state, beyond rounding, largest first; equal ones in their order."""
    values = [(term, term.contribution(state)) for term in equation.terms]
    total = sum(abs(value) for _, value in values)
    return sorted((Contribution(term, value, abs(value) / total) for term, value in values
                   if abs(value) > ROUNDING * total), key=lambda row: -abs(row.value))


def term_text(term: Term, writer=TEXT_WRITER) -> str:
    """Return a term with its sign on one line."""
    sign, text = writer.term(term)
    return ((writer.notation.minus if sign < 0 else '') + text).replace(SOFT_BREAK, ' ')


def sides(equation: Equation, state: State) -> tuple[float, float]:
    """Return the sums of the left and of the right side, N m or N: equal where the motion obeys the equation."""
    rounding = ROUNDING * sum(abs(term.contribution(state)) for term in equation.terms)
    left, right = (sum(term.contribution(state) for term in side) for side in (equation.left, equation.right))
    return (left if abs(left) > rounding else 0.0), (right if abs(right) > rounding else 0.0)


def contributions_table(equations: Equations, chosen, state: State, title: str) -> str:
    """Return the state and, for each equation, its terms by size, as text for a terminal."""
    blocks = ['\n'.join(_state_lines(equations, state, title))]
    for equation in chosen or equations:
        coordinate, rows = equation.coordinate, contributions(equation, state)
        left, right = (DIGITS.format(side) for side in sides(equation, state))
        lines = heading(equation, f': left side {left} {coordinate.unit}, right side {right} {coordinate.unit}')
        if rows:
            lines.append(f'{coordinate.unit:>13}  share  side   kind          term')
        lines += [f'{DIGITS.format(row.value):>13}  {row.share:5.1%}  {row.term.side:5}  {row.term.kind:12}  '
                  f'{term_text(row.term)}' for row in rows]
        zeros = len(equation.terms) - len(rows)
        if zeros:
            lines.append(f'{"0":>13}  {zeros} more {"term is" if zeros == 1 else "terms are"} zero here')
        blocks.append('\n'.join(lines))
    return '\n\n'.join(blocks) + '\n'


def _state_lines(equations: Equations, state: State, title: str) -> list[str]:
    """Return the state in the coordinates of the equations; efforts are those of the joints."""
    efforts = {joint.name: state.effort[k] for k, joint in enumerate(equations.chain.joints)}
    lines = [f'{equations.chain.name} {title}',
             f'{"":6}{"position":>13}{"velocity":>13}{"acceleration":>14}{"joint effort":>14}  joint']
    for unknown, motion in zip(equations.unknowns, state.motion.T):
        joint, symbol = unknown.joint, TEXT.coordinate(unknown)
        numbers = [DIGITS.format(number) for number in (*motion, efforts[joint])]
        lines.append(symbol + ' ' * (6 - display_width(symbol))
                     + '{:>13}{:>13}{:>14}{:>14}  '.format(*numbers) + joint)
    return [*lines, 'SI units; ' + ('angles are absolute, their efforts those of the joints.'
                                    if equations.coordinates == 'absolute' else 'joint coordinates.')]


def contributions_latex(equations: Equations, chosen, state: State, title: str) -> str:
    """Return the same tables in LaTeX."""
    lines = [f'% {equations.chain.name} {title}']
    for equation in chosen or equations:
        coordinate = equation.coordinate
        lines += [f'% ({equation.number}) for {coordinate}, joint {coordinate.joint}, in {coordinate.unit}',
                  r'\begin{tabular}{rrlll}', rf'{coordinate.unit} & share & side & kind & term \\ \hline']
        lines += [rf'${LATEX.number(row.value)}$ & {100.0 * row.share:.1f}\,\% & {row.term.side} & {row.term.kind} & '
                  rf'${term_text(row.term, LATEX_WRITER)}$ \\' for row in contributions(equation, state)]
        lines += [r'\end{tabular}', '']
    return '\n'.join(lines)
