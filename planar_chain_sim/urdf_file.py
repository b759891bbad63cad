"""The executable `urdf`: writes a chain as a URDF file."""
from __future__ import annotations

import sys
import warnings

from .chain.section import clipped
from .chain_file import load_chain
from .command_line import add_hold, Parser, refuse_existing, run_command, write_document
from .errors import Mistake, RobotFileNote
from .robot_files.urdf_writer import COMMANDS, left_out, STATES, TOPIC, urdf_of


def main(arguments=None) -> int:
    """Run the executable `urdf`."""
    return run_command('urdf', _write, arguments)


def _write(arguments) -> int:
    parser = Parser('urdf', 'Write a chain as URDF: for robot_state_publisher, RViz, MuJoCo, Pinocchio and others.\n'
                    'A URDF has no springs and rotors; the initial state is in the <ros2_control> block.',
                    'urdf four_link_robot.yaml --output four_link_robot.urdf')
    parser.add_argument('chain', help='chain file (YAML, URDF or MJCF)')
    parser.add_argument('--output', metavar='FILE', help='file to write (default: standard output)')
    parser.add_argument('--commands', metavar='TOPIC', default=COMMANDS,
                        help=f'topic of commands in the <ros2_control> block (default: {COMMANDS})')
    parser.add_argument('--states', metavar='TOPIC', default=STATES, help=f'topic of states there (default: {STATES})')
    add_hold(parser)
    options = parser.parse_args(arguments)
    for flag in ('commands', 'states'):
        if not TOPIC.fullmatch(getattr(options, flag)):
            raise Mistake(f'--{flag} is {clipped(getattr(options, flag))!r}, must be a topic such as /joint_states')
    chain = load_chain(options.chain, options.hold)
    if lost := left_out(chain):
        warnings.warn(f'not in the URDF: {"; ".join(lost)}', RobotFileNote)
    text = urdf_of(chain, options.commands, options.states)
    if options.output is None:
        write_document(text)
        return 0
    try:
        refuse_existing(options.output)
        with open(options.output, 'w', encoding='utf-8') as stream:
            stream.write(text)
    except (OSError, ValueError) as error:
        raise Mistake(f'{options.output!r}: {getattr(error, "strerror", None) or error}') from None
    return 0


if __name__ == '__main__':
    sys.exit(main())
