"""A chain's equations of motion as JSON for programs: every number in full, every factor as an ASCII expression."""
from __future__ import annotations

from dataclasses import replace
import json
from typing import Optional, Sequence

from .equations import Equations
from .factors import State
from .terms import Equation, Term
from .topology import carrier_number, matrices, vectors_by_angle
from ..mechanics.path_matrix import shared_mass_matrix


def json_document(equations: Equations, chosen: Optional[Sequence[Equation]] = None,
                  state: Optional[State] = None) -> str:
    """Return topology, symbols, vectors and equations, all or the `chosen` ones; at a state, what each term gives."""
    chain = equations.chain
    data = {
        'chain': chain.name, 'coordinates': equations.coordinates, 'trigonometric': equations.trigonometric,
        'numeric': equations.numeric,
        'bodies': [{'number': i + 1, 'name': body.name, 'carrier': carrier_number(chain, i)}
                   for i, body in enumerate(chain.bodies)],
        'topology': {**{name: matrix.tolist() for name, matrix in matrices(chain).items()},
                     'M': shared_mass_matrix(chain).tolist()},
        'symbols': {name: {'value': symbol.value, 'unit': symbol.unit, 'meaning': symbol.meaning}
                    for name, symbol in equations.symbols(chosen).items()},
        'vectors': _vectors(equations, chosen),
        'equations': [{
            'coordinate': equation.coordinate.name, 'joint': equation.coordinate.joint, 'number': equation.number,
            'unit': equation.coordinate.unit, 'left': [_term(term, state) for term in equation.left],
            'right': [_term(term, state) for term in equation.right]} for equation in chosen or equations]}
    return _lines(data) + '\n'


def _vectors(equations: Equations, chosen: Optional[Sequence[Equation]]) -> dict:
    """Return the angle of each vector that is not turned, and of the same turned by pi/2."""
    found = {}
    for row in vectors_by_angle(chosen or equations):
        for vector in row:
            angle = [str(coordinate) if sign > 0 else f'-{coordinate}' for sign, coordinate in vector.parts]
            angle += [repr(offset.value) if equations.numeric else offset.name for offset in vector.offsets]
            text = ' + '.join(angle).replace('+ -', '- ') or '0'
            for turned in (False, True) if vector.letter != 'g' else (False,):
                found[replace(vector, turned=turned).name] = {
                    'angle': f'{text} + pi/2' if turned else text,
                    'length': vector.length.value if vector.length else 1.0}
    return found


def _term(term: Term, state: Optional[State]) -> dict:
    data = {'kind': term.kind, 'number': term.coefficient.number,
            'symbols': [symbol.name for symbol in term.coefficient.symbols], 'factors': list(map(str, term.factors)),
            'expression': str(term)}
    return data if state is None else {**data, 'contribution': term.contribution(state)}


def _lines(value, indent: int = 0) -> str:
    """JSON with a line for each term, matrix row, symbol and vector."""
    items = list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else []
    nested = [item for item in items if isinstance(item, (dict, list))]
    if isinstance(value, dict):     # a term, whose lists are flat, stays on its line
        nested = [item for item in nested
                  if isinstance(item, dict) or any(isinstance(entry, (dict, list)) for entry in item)]
    if not nested:
        return json.dumps(value, allow_nan=False)
    keys = [f'{json.dumps(key)}: ' for key in value] if isinstance(value, dict) else [''] * len(items)
    pad = '\n' + ' ' * (indent + 1)
    body = ','.join(f'{pad}{key}{_lines(item, indent + 1)}' for key, item in zip(keys, items))
    opening, closing = '{}' if isinstance(value, dict) else '[]'
    return f'{opening}{body}\n{" " * indent}{closing}'
