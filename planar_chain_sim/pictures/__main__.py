"""Draw how a chain moves, or what a log holds: `python -m planar_chain_sim.pictures`."""
from __future__ import annotations

import sys

from .motion import draw_motion
from ..chain_file import load_chain
from ..command_line import add_hold, Parser, PICTURES_NEED, refuse_existing, refuse_hold, run_command
from ..errors import Mistake
from ..motion.rollout import rollout

PICTURES = ('.png', '.svg')
STEP, LONGEST = 1e-3, 1e4   # s: of the motion that is drawn


def main(arguments=None) -> int:
    """Exit 0: drawn; 2: a mistake."""
    return run_command('pictures', _picture, arguments)


def _picture(arguments) -> int:
    program = 'python -m planar_chain_sim.pictures'
    parser = Parser(program, 'Draw how a chain moves from its initial state with no effort, or what a log holds.',
                    f'{program} config/four_link_robot.yaml docs/four_link_robot.png')
    parser.add_argument('chain', help='chain file, or an MCAP log')
    parser.add_argument('output', help='PNG or SVG file')
    add_hold(parser)
    parser.add_argument('--duration', type=float, default=12.0, metavar='S', help='simulated time, s (default: 12)')
    options = parser.parse_args(arguments)
    if not options.output.endswith(PICTURES):
        raise Mistake(f'{options.output!r}: must end in {" or ".join(map(repr, PICTURES))}')
    if not STEP <= options.duration <= LONGEST:
        raise Mistake(f'--duration is {options.duration:g} s, must be from {STEP:g} to {LONGEST:g} s')
    refuse_existing(options.output)
    try:
        if options.chain.endswith('.mcap'):
            refuse_hold(options)
            from .log import draw_log
            from ..recording.log import load_log
            draw_log(load_log(options.chain), options.output)
        else:
            chain = load_chain(options.chain, options.hold)
            draw_motion(chain, rollout(chain, round(options.duration / STEP) * STEP, STEP), options.output)
    except OSError as error:
        if error.filename is None:   # of no file
            raise
        raise Mistake(f'{options.output!r}: {error.strerror}') from None
    except ImportError as error:
        raise Mistake(f'{error}: {PICTURES_NEED}') from None
    return 0


if __name__ == '__main__':
    sys.exit(main())
