"""compare: a recorded run beside a changed one, and the report that answers whether the change mattered."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, Optional, Union

import numpy as np

from .changed_run import changed_simulation, ChangedRun
from .deviation import DECADES, Deviation
from ..chain.chain import Chain
from ..chain.section import clipped, counted
from ..errors import Mistake
from ..motion.simulation import Simulation
from ..recording.bag import Bag
from ..recording.following import Following
from ..recording.log_reader import LogFile

MOST = 12      # changes that are listed
SHIFT = 1e-9   # rad/s or m/s; how soon it alone shows says how strongly the motion amplifies


@dataclass(frozen=True)
class Comparison:
    """
    How a changed run differs from the recorded one. `start`, `end`: the times compared, s.

    `amplified_from`: when the run that is not changed, with SHIFT added to its velocities at the start, differs from
    itself by more than the threshold, s; None: it does not.
    """

    recorded: Union[LogFile, Bag]
    notes: list              # sentences about what was assumed of it
    own: Simulation          # the recorded run's, at its start
    run: ChangedRun
    what: list               # is changed, one text each
    joints: tuple            # that both have
    deviation: Deviation
    start: float
    end: float
    amplified_from: Optional[float]

    @property
    def agrees(self) -> bool:
        """Whether no position differs by more than the threshold before the motion amplifies any difference."""
        apart = self.deviation.apart_from
        return not self.run.stopped and (apart is None or (
            self.amplified_from is not None and apart >= self.amplified_from))


def compare(recorded: Union[LogFile, Bag], follow: Callable[[Callable[[dict, Chain], object]], Following],
            change: Callable[[Simulation], Simulation], threshold: float) -> Comparison:
    """
    Compare what was recorded with the run of `change(its simulation at the start)`; `threshold` rad or m.

    `follow(told)` returns a fresh Following of it. LogError: it cannot be used. Mistake: what is changed cannot be.
    """
    runs: list[ChangedRun] = []

    def repeat(event, before) -> None:
        for run in runs:
            run.change(event, before, following.effort)

    following = follow(repeat)
    own = following.simulation
    changed = ChangedRun(own, change(own))
    twins = [ChangedRun(own, changed_simulation(own), shift) for shift in (0.0, SHIFT)]
    runs += [changed, *twins]
    mine, theirs = changed.mine, changed.theirs
    deviation = Deviation(len(mine), threshold)
    simulation, start, amplified_from = changed.simulation, own.tick * own.step, None
    end, what = start, _changes(own, simulation)
    for tick, message in following.states():
        if not changed.meets(tick):
            continue
        state, time = following.decode(message), tick * own.step
        changed.advance_to(tick)
        if changed.stopped:
            break
        deviation.add(time, state.position[theirs], state.velocity[theirs], simulation.position[mine],
                      simulation.velocity[mine])
        end = time
        if twins:
            for twin in twins:
                twin.advance_to(tick)
            if any(twin.stopped for twin in twins):
                runs, twins = [changed], []
            elif np.ptp([twin.simulation.position[theirs] for twin in twins], axis=0).max() > threshold:
                runs, twins, amplified_from = [changed], [], time
    if deviation.close().states == 0 and not changed.stopped:
        raise following.error('it holds no state to compare with')
    if deviation.states == 1 and simulation.step > own.step:
        raise Mistake(f'--step is {simulation.step:g} s, must be shorter than what the log holds')
    joints = tuple(own.chain.joint_names[k] for k in theirs.tolist())
    return Comparison(recorded, following.notes, own, changed, what, joints, deviation, start, end, amplified_from)


def _changes(own: Simulation, simulation: Simulation) -> list:
    """Return what differs between two simulations, one text each."""
    chain, before = simulation.chain, own.own_chain
    what = [f'{name} {_shown(getattr(own, name))} -> {_shown(getattr(simulation, name))}{unit}'
            for name, unit in (('method', ''), ('tolerance', ''), ('step', ' s'))
            if getattr(own, name) != getattr(simulation, name)]
    if chain.name != before.name:
        what.append(f'chain {clipped(before.name)} -> {clipped(chain.name)}')
    numbers, others = chain.parameters, before.parameters
    what += [f'{clipped(name)} {others[name]:.6g} -> {value:.6g}' for name, value in numbers.items()
             if name in others and others[name] != value]
    return what


def _shown(setting) -> str:
    return 'none' if setting is None else setting if isinstance(setting, str) else f'{setting:g}'


def report(comparison: Comparison) -> str:
    """Return the table of joints, what must be known about it, and the answer as the last line."""
    lines = [*_headlines(comparison), '', *_table(comparison), '', *_notes(comparison), _answer(comparison)]
    return '\n'.join(lines) + '\n'


def _headlines(comparison: Comparison) -> list:
    own, run, deviation = comparison.own, comparison.run, comparison.deviation
    what, simulation = comparison.what, run.simulation
    shown = [*what[:MOST], *([f'{len(what) - MOST} more'] if len(what) > MOST else [])]
    settings = f'method {simulation.method}, ' + (
        f'tolerance {simulation.tolerance:g}, ' if simulation.tolerance else '') + f'step {simulation.step:g} s'
    lines = [f'{comparison.recorded.path}: {counted(deviation.states, "state")} of {own.chain.name}, t = '
             f'{comparison.start:.6g} to {comparison.end:.6g} s, compared with a run by {settings}',
             f'Changed: {"; ".join(shown) or "nothing"}', *comparison.notes]
    if not comparison.recorded.complete:
        lines.append('The file was not closed properly, only its whole chunks were compared.')
    for where, chain in (('recorded', own.chain), ('changed', run.simulation.own_chain)):
        alone = [name for name in chain.joint_names if name not in comparison.joints]
        if alone:
            lines.append(f'Joints of the {where} run alone, which are not compared: {clipped(", ".join(alone), 200)}')
    return lines


def _table(comparison: Comparison) -> list:
    deviation, chain = comparison.deviation, comparison.run.simulation.chain
    kinds = {joint.name: joint.kind for joint in chain.joints}
    rows: list[tuple] = [('joint', 'position: largest', 'RMS', 'velocity: largest', 'RMS',
                          f'above {deviation.threshold:g} from t, s')]
    for k, name in enumerate(comparison.joints):
        cells = [f'{values[quantity, k]:.3g}' for quantity in range(2) for values in (deviation.largest, deviation.rms)]
        apart = deviation.apart[k]
        rows.append((f'{clipped(name)}, {"m" if kinds[name] == "slide" else "rad"}', *cells,
                     'never' if np.isnan(apart) else f'{apart:.6g}'))
    widths = [max(map(len, column)) for column in zip(*rows)]
    return ['  '.join(cell.ljust(width) if k == 0 else cell.rjust(width)
                      for k, (cell, width) in enumerate(zip(row, widths))) for row in rows]


def _notes(comparison: Comparison) -> list:
    run, deviation, notes = comparison.run, comparison.deviation, []
    if run.late:
        notes.append(f'{counted(run.late, "change")} at times that are no tick of {run.simulation.step:g} s acted at '
                     f'the next tick, at most {run.latest:.3g} s later.')
    notes += [f'Left out {counted(count, "time")}: {what}.' for what, count in run.unused.items()]
    grown = [f'{level:g} from t = {time:.6g} s' for level, time in zip(DECADES, deviation.grown) if not np.isnan(time)]
    if grown and not deviation.equal:
        notes.append(f'The largest difference of a position, rad or m, is above {", ".join(grown)}.')
    if comparison.amplified_from is not None:
        notes.append(f'From t = {comparison.amplified_from:.6g} s on this motion amplifies: there, {SHIFT:g} rad/s or '
                     f'm/s more at the start alone make a difference above {deviation.threshold:g} rad or m.')
    return notes


def _answer(comparison: Comparison) -> str:
    run, deviation = comparison.run, comparison.deviation
    no, yes, little = ('No, it does not matter', 'Yes, it matters',
                       'No, it matters no more than a rounding error would') if comparison.what else (
        'It is repeated', 'It is not repeated', 'It is repeated as far as any run can be')
    if run.stopped:
        return f'{yes}: the computed run stops ({run.stopped}).'
    if deviation.equal:
        return f'{no}: {counted(deviation.states, "state")} equal, bit for bit.'
    k = int(deviation.largest[0].argmax())
    largest = (f'the largest difference of a position is {deviation.largest[0, k]:.3g} '
               f"{_unit(run, comparison.joints[k])}, joint '{comparison.joints[k]}' at t = "
               f'{deviation.largest_at[0, k]:.6g} s')
    apart, limit = deviation.apart_from, f'{deviation.threshold:g} rad or m'
    if apart is None:
        return f'{no}: no position differs by more than {limit}; {largest}.'
    first = comparison.joints[int(np.nanargmin(deviation.apart))]
    if comparison.agrees:
        return (f'{little}: positions differ by more than {limit} only from t = {apart:.6g} s on, when the motion '
                f'amplifies any difference; {largest}.')
    return (f"{yes}: from t = {apart:.6g} s on positions differ by more than {limit}, first joint '{first}'; "
            f'{largest}.')


def _unit(run: ChangedRun, joint: str) -> str:
    chain = run.simulation.chain
    return 'm' if chain.joints[chain.joint_names.index(joint)].kind == 'slide' else 'rad'
