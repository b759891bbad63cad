"""benchmark: measure, print a table, keep it as CSV and as a picture."""
from __future__ import annotations

import csv
from importlib import import_module
from pathlib import Path
import sys
from typing import NamedTuple, Optional
import warnings

from .table import shown, table_lines
from ..command_line import Parser, PICTURES_NEED, refuse_existing, run_command
from ..errors import Mistake


class Suite(NamedTuple):
    """A module with COLUMNS and `rows()`, and a text on it; imported when it is used, as only some of them need ROS."""

    module: str
    text: str


SUITES = {
    'work-precision': Suite('work_precision', 'CPU time against error on named problems, every method and every peer'),
    'references': Suite('references',
                        'final states of the named problems, by two integrations in many digits; takes minutes'),
    'step-time': Suite('step_time', 'one evaluation and one step of serial chains of 1 to 512 links, with peers'),
    'calls': Suite('calls', 'every call from Python against the time of its kernel, and Pinocchio called from Python'),
    'scaling': Suite('scaling', 'evaluation, load time and memory of serial chains of up to 4096 links'),
    'skipping': Suite('skipping', 'what each feature of a scene costs, and what its absence saves'),
    'batch': Suite('batch', 'many states at once: evaluations and steps per core-second, with peers'),
    'energy': Suite('energy_drift', 'energy error of the double pendulum over 1000 s, and its growth with time'),
    'stability': Suite('stability', 'scenes that try to break the integrator, checked against limits, with MuJoCo'),
    'node': Suite('node_load', 'the ROS 2 node: time to the first joint_states, CPU share and lateness at 1 kHz'),
}
NOT_OF_ALL = ('references', 'stability', 'node')   # the first two take long, the last needs ROS 2


def _module(name: str):
    return import_module(f'{__package__}.{SUITES[name].module}')


def _show_progress(text: str) -> None:
    """Write a line on a terminal that the next one replaces."""
    if sys.stderr is not None and sys.stderr.isatty():
        print(f'\r\x1b[K{text[:78]}', end='', file=sys.stderr, flush=True)


def _touch(path: Optional[Path], flag: str) -> None:
    """Raise Mistake if a file cannot be written."""
    if path is None:
        return
    if flag == '--picture' and path.suffix not in ('.png', '.svg'):
        raise Mistake(f"--picture is {str(path)!r}, must end in '.png' or '.svg'")
    try:
        path.open('ab').close()
        if path.is_file() and not path.stat().st_size:   # none is left after Ctrl-C, which the next run would refuse
            path.unlink()
    except OSError as error:
        raise Mistake(f'{flag} {str(path)!r}: {error.strerror}') from None


def _write(path: Path, table) -> None:
    with open(path, 'w', newline='') as file:
        csv.writer(file).writerows(table)


def _summary_file(table_file: Path) -> Path:
    return table_file.with_name(f'{table_file.stem}_summary{table_file.suffix}')


def _open_peers(wanted: Optional[str]) -> dict:
    """Return the peers of a list of names, all where None; say which were found and why others were not; Mistake."""
    from .peers import open_peers, PEERS
    names = list(PEERS) if wanted is None else [] if wanted == 'none' else wanted.split(',')
    for name in names:
        if name not in PEERS:
            raise Mistake(f'--peers: there is no {name!r}, must be none or some of {",".join(PEERS)}')
    found, missing = open_peers(names)
    print('peers:', ', '.join(f'{name} {peer.version}' for name, peer in found.items()) or 'none')
    for name, reason in missing.items():
        print(f'not measured: {name}: {reason}')
    return found


def run_suite(name: str, table_file: Optional[Path], picture: Optional[Path], quick: bool, peers: dict) -> None:
    """Measure a suite: print its table and its summary, write CSV and picture; Mistake."""
    module = _module(name)
    for file, flag in ((table_file, '--csv'), (picture, '--picture')):   # before minutes of measuring
        _touch(file, flag)
    table = []
    try:
        for row in module.rows(peers, quick):
            table.append(row)
            _show_progress(f'{len(table)} rows, {", ".join(map(shown, row[:3]))}')
    finally:   # what there is after Ctrl-C, too
        _show_progress('')
        if table:
            print('\n'.join(table_lines(module.COLUMNS, table)), flush=True)
    if table_file:
        _write(table_file, [module.COLUMNS, *table])
    if hasattr(module, 'summary'):
        columns, summary = module.summary(table)
        print('\n'.join(['', *table_lines(columns, summary)]), flush=True)
        if table_file:
            _write(_summary_file(table_file), [columns, *summary])
    if picture:
        try:
            module.draw(table, picture)
        except ImportError as error:
            raise Mistake(f'{error}: {PICTURES_NEED}') from None


def _benchmark(arguments) -> int:
    suites = '\n'.join(f'  {name}: {suite.text}' for name, suite in SUITES.items())
    parser = Parser('benchmark', f'Measure and print:\n{suites}\n  all: all of these except {", ".join(NOT_OF_ALL)}',
                    'benchmark work-precision --csv work_precision.csv --picture work_precision.svg')
    parser.add_argument('suite', choices=(*SUITES, 'all'), metavar='SUITE', help='one of the suites above')
    parser.add_argument('--csv', metavar='FILE', type=Path, help='write the table to this file too')
    parser.add_argument('--picture', metavar='FILE', type=Path, help='draw the table; the ending chooses PNG or SVG')
    parser.add_argument('--folder', metavar='FOLDER', type=Path, help='for `all`: where CSVs and pictures go')
    parser.add_argument('--peers', metavar='NAMES', help='measure only these other libraries, as A,B; or none')
    parser.add_argument('--quick', action='store_true', help='few and coarse settings, to check that it runs')
    options = parser.parse_args(arguments)
    if (options.suite == 'all') != (options.folder is not None):
        raise Mistake('--folder is required by `all` and is for it alone')
    if options.suite == 'all' and (options.csv or options.picture):
        raise Mistake('--csv and --picture go with one suite, `all` takes --folder')
    for output in (options.csv, options.csv and _summary_file(options.csv), options.picture):
        if output:
            refuse_existing(str(output))
    if options.picture and not hasattr(_module(options.suite), 'draw'):
        raise Mistake(f'{options.suite} has no picture')
    peers = _open_peers(options.peers) if options.suite not in ('references', 'node') else {}
    if options.suite != 'all':
        run_suite(options.suite, options.csv, options.picture, options.quick, peers)
        return 0
    try:
        options.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Mistake(f'--folder {str(options.folder)!r}: {error.strerror}') from None
    for name in SUITES:
        if name not in NOT_OF_ALL:
            print(f'\n== {name}: {SUITES[name].text}', flush=True)
            picture = options.folder / f'{name}.svg' if hasattr(_module(name), 'draw') else None
            run_suite(name, options.folder / f'{name}.csv', picture, options.quick, peers)
    return 0


def main(arguments=None) -> int:
    """Exit 0: measured; 2: a mistake."""
    # Steps that are too long belong to what is measured.
    warnings.filterwarnings('ignore', 'step is', RuntimeWarning)
    return run_command('benchmark', _benchmark, arguments)


if __name__ == '__main__':
    sys.exit(main())
