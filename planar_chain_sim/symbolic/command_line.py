"""equations: a chain's own equations of motion, and what each of their terms contributes at a state."""
from __future__ import annotations

from pathlib import Path
import sys
from typing import Optional

import numpy as np

from .contributions import contributions_latex, contributions_table
from .equations import Equations, equations
from .json_document import json_document
from .latex_document import latex_document
from .text_document import text_document
from ..chain.chain import Chain
from ..chain.section import clipped
from ..chain_file import load_chain
from ..command_line import add_hold, Parser, PICTURES_NEED, refuse_existing, refuse_hold, run_command, write_document
from ..errors import Mistake

FORMATS = {'text': text_document, 'latex': latex_document, 'json': json_document}
PICTURES = ('.png', '.svg')
PARTS = ('position', 'velocity', 'effort')


def main(arguments=None) -> int:
    """Exit 0: printed; 2: a mistake."""
    return run_command('equations', _equations, arguments)


def _parser() -> Parser:
    parser = Parser(
        'equations', "Print a chain's equations of motion by the path-matrix method, (5.87) for every angle and (5.88) "
        'for every slide.\nAt a state, print what each of their terms contributes, largest first.',
        'equations config/four_link_robot.yaml --trigonometric\n'
        '  equations config/four_link_robot.yaml --state initial --picture terms.png\n'
        '  equations config/double_pendulum.yaml --joint --state 0.5,-0.2/1.0,0/0,0.3 --coordinate upper_joint')
    parser.add_argument('chain', metavar='CHAIN', help='chain file (YAML, URDF or MJCF); relative to the working '
                        "directory, else to the package's config; or a log (.mcap), which contains its chain")
    add_hold(parser)
    parser.add_argument('--format', default='text', choices=list(FORMATS), help='default text')
    parser.add_argument('--joint', action='store_true', help='in joint coordinates (default: in absolute angles)')
    parser.add_argument('--trigonometric', action='store_true', help='sines and cosines instead of scalar products')
    parser.add_argument('--numeric', action='store_true', help='numbers instead of symbols, like terms added')
    parser.add_argument('--coordinate', metavar='NAME', help='only this equation: the name of a joint, or phi1, x1')
    parser.add_argument('--state', metavar='S', help='print what each term contributes at this state: POSITION, '
                        'POSITION/VELOCITY or POSITION/VELOCITY/EFFORT of the joints, numbers joined by commas in the '
                        "order of the file; or 'initial', the chain file's state. Accelerations are computed from it")
    parser.add_argument('--time', type=float, metavar='S', help='for a log: the state of the tick nearest to '
                        'this simulated time, s, and the effort that led to it')
    parser.add_argument('--picture', metavar='FILE', help='also draw the equations, or with a state bars of the '
                        'terms; the ending chooses PNG or SVG')
    return parser


def _equations(arguments) -> int:
    options = _parser().parse_args(arguments)
    if options.picture is not None and Path(options.picture).suffix not in PICTURES:
        raise Mistake(f'--picture {options.picture!r}: must end in {" or ".join(map(repr, PICTURES))}')
    if options.picture is not None:
        refuse_existing(options.picture)
    if options.time is not None and options.state is not None:
        raise Mistake('--state and --time both give a state, must be one of them')
    chain, state, title = _chain_and_state(options)
    made = equations(chain, 'joint' if options.joint else 'absolute', options.trigonometric, options.numeric)
    chosen = None if options.coordinate is None else [_choose(made, options.coordinate)]
    at = None if state is None else made.state(state[0], state[1], effort=state[2])
    if options.format == 'json':
        text = json_document(made, chosen, at)
    elif at is None:
        text = FORMATS[options.format](made, chosen)
    else:
        text = (contributions_latex if options.format == 'latex' else contributions_table)(made, chosen, at, title)
    if options.picture is not None:
        _draw(made, chosen, at, title, options.picture)
    write_document(text)
    return 0


def _choose(made: Equations, name: str):
    """Return the equation of a name; Greek letters and subscripts stand for the ASCII of expressions."""
    plain = name.replace('\u03c6', 'phi').translate({0x2080 + digit: str(digit) for digit in range(10)})
    for one in (name, plain):
        try:
            return made[one]
        except KeyError as error:
            reason = error.args[0]
    raise Mistake(f'--coordinate: {reason}')


def _chain_and_state(options) -> tuple[Chain, Optional[tuple], str]:
    """Return the chain, the state wanted (position, velocity, effort), None for none, and how to call the state."""
    if options.chain.endswith('.mcap'):
        refuse_hold(options)
        from .logged_state import state_at
        from ..recording.log_reader import read_log
        from ..recording.run_settings import simulation_of
        log = read_log(options.chain)
        if options.time is not None:
            chain, time, *state = state_at(log, options.time)
            return chain, tuple(state), f'at t = {time:g} s of {Path(options.chain).name}'
        chain = simulation_of(log).chain
    else:
        chain = load_chain(options.chain, options.hold)
        if options.time is not None:
            raise Mistake(f'--time is of a log, but {clipped(options.chain)!r} does not end in .mcap')
    if options.state is None:
        return chain, None, ''
    if options.state == 'initial':
        zero = np.zeros(chain.joint_count)
        return chain, (*(np.array([getattr(joint, quantity) for joint in chain.joints])
                         for quantity in ('position', 'velocity')), zero), 'at its initial state'
    return chain, read_state(options.state, chain), 'at the state given'


def read_state(text: str, chain: Chain) -> tuple:
    """Return position, velocity, effort (joints,) from 'P/V/E', numbers joined by commas; Mistake if they are not."""
    fields = text.split('/')
    wanted = f"must be 'initial' or {chain.joint_count} positions, /velocities, /efforts, numbers joined by commas"
    if len(fields) > len(PARTS):
        raise Mistake(f'--state {clipped(text)!r} has {len(fields)} parts, {wanted}')
    rows = []
    for quantity, field in zip(PARTS, fields):
        try:
            values = [float(number) for number in field.split(',')]
        except ValueError as error:
            raise Mistake(f'--state {clipped(text)!r}: {quantity} is not a list of numbers ({error}), '
                          f'{wanted}') from None
        if len(values) != chain.joint_count:
            raise Mistake(f'--state {clipped(text)!r}: {quantity} has {len(values)} numbers, must have '
                          f'{chain.joint_count}, for {clipped(", ".join(chain.joint_names), 200)}')
        if not np.isfinite(values).all():
            raise Mistake(f'--state {clipped(text)!r}: {quantity} has a number that is not finite, must be finite')
        rows.append(np.array(values))
    zero = np.zeros(chain.joint_count)
    return tuple(rows[k] if k < len(rows) else zero for k in range(len(PARTS)))


def _draw(made: Equations, chosen, at, title: str, path: str) -> None:
    from .drawing import draw_contributions, draw_equations
    try:
        if at is None:
            draw_equations(made, chosen, path)
        else:
            draw_contributions(made, chosen, at, title, path)
    except OSError as error:
        raise Mistake(f'--picture {path!r}: {error.strerror}') from None
    except ImportError as error:
        raise Mistake(f'--picture {path!r}: {error}: {PICTURES_NEED}') from None


if __name__ == '__main__':
    sys.exit(main())
