"""CPU time against error at the end of the named problems: every method here, every peer found, in one run."""
from __future__ import annotations

import sys
from typing import Iterator, Optional

import numpy as np

from .cpu_time import interleaved
from .peers import Curve, half_decades, Run, steps_of
from .problems import Problem, PROBLEMS
from ..motion.integrators import METHODS
from ..motion.simulation import Simulation

OWN = 'planar_chain_sim'
COLUMNS = ('problem', 'library', 'method', 'kind', 'setting', 'error', 'evaluations', 'steps', 'rejected steps',
           'CPU median, ms', 'CPU min, ms')
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
ROUNDS = 21
LIMIT = 0.15     # s: a setting that takes this long ends its curve
BUDGET = 0.1     # s of readings per setting
ROUND_OFF = 1e-13   # in the picture: less is luck
PATIENCE = 6     # settings in a row that bring no smaller error end it too


def own_integration(problem: Problem, method: str, step: float, tolerance: Optional[float]) -> Run:
    """Return an integration by one of METHODS or 'auto'; an adaptive one makes one tick of the whole duration."""
    simulation = Simulation(problem.chain(), method, step, tolerance)
    start, ticks = (simulation.position, simulation.velocity), round(problem.duration / step)

    def go():
        simulation.set_state(*start)
        simulation.advance(ticks)

    def end():
        before = simulation.statistics
        go()
        after = simulation.statistics
        return simulation.position, *(after[name] - before[name] for name in ('evaluations', 'steps', 'rejected_steps'))
    return Run(go, end)


def own_curves(problem: Problem) -> list[Curve]:
    """Return a curve for every row of METHODS, and for 'auto' where it has error control."""
    curves = []
    adaptive = {name: row.adaptive for name, row in METHODS.items()}
    try:
        Simulation(problem.chain(), 'auto', problem.duration, 1e-6)
        adaptive['auto'] = True
    except ValueError:   # it stands for a method with a fixed step
        pass
    for name, controlled in adaptive.items():
        if controlled:
            curves.append(Curve(OWN, name, 'tolerance', half_decades(-1, -16), lambda tolerance, name=name: (
                own_integration(problem, name, problem.duration, tolerance))))
        else:
            curves.append(Curve(OWN, name, 'step', steps_of(problem.duration), lambda step, name=name: (
                own_integration(problem, name, step, None))))
    return curves


def _tried(problem: Problem, curve: Curve, limit: float) -> list[tuple]:
    """Return (setting, run, error, counts) along a curve, one at least, up to a cost of `limit` s or the best."""
    kept, best, idle = [], np.inf, 0
    for setting in curve.settings:
        try:
            run = curve.start(setting)
            run.go()
            position, *counts = run.end()
        except (RuntimeError, ValueError):   # too coarse a step runs away; a method may refuse a setting
            continue
        error = problem.error(position)
        idle = 0 if error < 0.8 * best else idle + 1
        best = min(best, error)
        if error < 1.0:
            kept.append((setting, run, (error, *counts)))
        seconds = _seconds(run)
        if seconds > limit and kept or idle >= PATIENCE:
            break
    return kept


def _seconds(run: Run) -> float:
    from time import process_time
    began = process_time()
    run.go()
    return process_time() - began


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """Yield rows of COLUMNS, problem by problem."""
    from tqdm import tqdm
    for name, problem in PROBLEMS.items():
        curves = own_curves(problem) + [curve for peer in peers.values() for curve in peer.curves(problem)]
        tried = [(curve, trial) for curve in tqdm(curves, f'{name}: errors', file=sys.stderr, leave=False, disable=None)
                 for trial in _tried(problem, curve, 0.0005 if quick else LIMIT)]

        def repeat(count, run):
            for _ in range(count):
                run.go()
        times = interleaved([lambda count, run=run: repeat(count, run) for _, (_, run, _) in tried],
                            2 if quick else ROUNDS, f'{name}: times', BUDGET)
        for (curve, (setting, _, counted)), seconds in zip(tried, times):
            yield (name, curve.library, curve.method, curve.kind, setting, *counted, np.median(seconds) * 1e3,
                   seconds.min() * 1e3)


def summary(table: list[tuple]) -> tuple[tuple, list[tuple]]:
    """
    Return columns and rows: the cheapest measured setting of each method that reaches each of TARGETS, median ms.

    After each problem: the fastest of each library, and how many times as long as ours each peer takes.
    """
    columns = ('problem', 'library', 'method', *(f'{target:g}: median, ms' for target in TARGETS),
               *(f'{target:g}: min, ms' for target in TARGETS))
    result = []
    for name in dict.fromkeys(row[0] for row in table):
        own = [row for row in table if row[0] == name]
        methods = dict.fromkeys((row[1], row[2]) for row in own)
        for library, method in methods:
            result.append((name, library, method, *_cheapest([row for row in own if row[1:3] == (library, method)])))
        for library in dict.fromkeys(row[1] for row in own):
            result.append((name, library, 'BEST', *_cheapest([row for row in own if row[1] == library])))
        ours = _cheapest([row for row in own if row[1] == OWN])
        for library in dict.fromkeys(row[1] for row in own if row[1] != OWN):
            theirs = _cheapest([row for row in own if row[1] == library])
            result.append((name, library, 'TIMES OURS', *(
                there / here if here and there else '' for here, there in zip(ours, theirs))))
    return columns, result


def _cheapest(table: list[tuple]) -> tuple:
    """Return the least median and the least minimum, ms, of the rows that reach each of TARGETS; '' where none does."""
    return tuple(min((row[column] for row in table if row[5] <= target), default='')
                 for column in (9, 10) for target in TARGETS)


def draw(table: list[tuple], path) -> None:
    """Draw a panel per problem: each library's cheapest setting for each error in bold, its methods behind."""
    from .charts import Chart
    names = list(dict.fromkeys(row[0] for row in table))
    chart = Chart(len(names), 'CPU time to reach an error, one core')
    for panel, name in enumerate(names):
        points = {}   # by library, by method
        for _, library, method, _, _, error, *_, median, _ in (row for row in table if row[0] == name and row[5] < 0.1):
            points.setdefault(library, {}).setdefault(method, []).append((max(error, ROUND_OFF), median))
        for library, methods in points.items():
            for found in methods.values():
                chart.line(panel, _frontier(found), library, library, bold=False)
            chart.line(panel, _frontier([point for found in methods.values() for point in found]), library, library)
        chart.axes(panel, PROBLEMS[name].title, 'largest joint error at the end, rad or m',
                   '' if panel else 'CPU time, ms (median)', error=True)
    chart.save(path)


def _frontier(points: list[tuple]) -> list[tuple]:
    """Return the points (error, time) than which no other is both finer and cheaper."""
    kept, cheapest = [], np.inf
    for error, time in sorted(points):
        if time < cheapest:
            kept.append((error, time))
            cheapest = time
    return kept
