"""benchmark: measure, print a table, keep it as CSV."""
from __future__ import annotations

import csv
import sys

from ..command_line import Mistake, Parser, run_command

SUITES = {
    'step-time': 'ns per evaluation and per RK4 tick of serial chains of 1 to 4096 links',
    'node': 'the ROS 2 node: time to the first joint_states, CPU share and lateness at 1 kHz with recording',
}


def _suite(name: str):
    """Columns and generator of rows, imported when asked for: only one of them needs ROS."""
    if name == 'step-time':
        from .step_time import COLUMNS, step_times as rows
    else:
        from .node_load import COLUMNS, node_load as rows
    return COLUMNS, rows


def _benchmark(arguments) -> int:
    suites = '\n'.join(f'  {name}: {text}' for name, text in SUITES.items())
    parser = Parser('benchmark', f'Measure and print:\n{suites}', 'benchmark step-time --csv step_time.csv')
    parser.add_argument('suite', choices=SUITES)
    parser.add_argument('--csv', metavar='FILE', help='write the table to this file too')
    options = parser.parse_args(arguments)
    columns, rows = _suite(options.suite)
    table = [columns]
    print(' | '.join(columns))
    for row in rows():
        table.append(row)
        print(' | '.join(f'{value:.4g}' if isinstance(value, float) else str(value) for value in row), flush=True)
    if options.csv:
        try:
            with open(options.csv, 'w', newline='') as file:
                csv.writer(file).writerows(table)
        except OSError as error:
            raise Mistake(f'--csv {options.csv!r}: {error.strerror}') from None
    return 0


def main(arguments=None) -> int:
    """Exit 0: measured; 2: a mistake."""
    return run_command('benchmark', _benchmark, arguments)


if __name__ == '__main__':
    sys.exit(main())
