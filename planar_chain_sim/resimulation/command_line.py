"""The executable `resimulate`: a log's run again, bit for bit."""
from __future__ import annotations

import sys

from .bits import resimulate
from ..chain.section import counted
from ..command_line import Parser, print_line, run_command
from ..recording.log_reader import read_log


def main(arguments=None) -> int:
    """Exit 0: every state equal, bit for bit; 1: different, first difference on stdout; 2: unreadable."""
    return run_command('resimulate', _resimulate_file, arguments)


def _resimulate_file(arguments) -> int:
    parser = Parser('resimulate',
                    'Run the chain of a log again, with its method, step and changes, and compare all states '
                    'bit for bit.\n\nExit code 0: equal; 1: different; 2: the log cannot be read, or there is a bug.',
                    'resimulate run.mcap')
    parser.add_argument('log', help='MCAP log of the simulator or of rollout')
    log = read_log(parser.parse_args(arguments).log)
    verdict = resimulate(log)
    torn = '' if log.complete else '; the log was not closed properly, only its whole chunks were compared'
    if verdict.difference is not None:
        print_line(f'different: {verdict.difference}{torn}')
        return 1
    print_line(f'equal: {counted(verdict.states, "state")} over {counted(verdict.ticks, "tick")}, bit for bit{torn}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
