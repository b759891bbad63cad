"""CPU time of runs that are to be compared: taken in turns, so that all of them meet the same noise of the machine."""
from __future__ import annotations

from math import ceil
import sys
from time import process_time
from typing import Callable, Sequence

import numpy as np

LEAST = 2e-3    # s: a run that is shorter is repeated within one reading
FEWEST = 3      # readings of even the dearest run


def interleaved(runs: Sequence[Callable[[int], None]], rounds: int, what: str = 'timing',
                budget: float = 2.0) -> list[np.ndarray]:
    """
    Return CPU seconds of one repetition of each run, an array of readings per run.

    Each run is called with the number of repetitions to make; all take their turn once per round. A run for which
    `rounds` readings would take more than `budget` s sits out some of the rounds.
    """
    from tqdm import tqdm
    counts, turns = [], []
    for run in runs:
        run(1)                                    # warm up
        once = _reading(run, 1)
        counts.append(max(1, ceil(LEAST / max(once, 1e-7))))
        readings = max(min(rounds, FEWEST), min(rounds, int(budget / (once * counts[-1]))))
        turns.append(set(np.linspace(0, rounds - 1, readings).round().astype(int)))
    times = [[] for _ in runs]
    for number in tqdm(range(rounds), desc=what, file=sys.stderr, leave=False, disable=None):
        for run, count, turn, readings in zip(runs, counts, turns, times):
            if number in turn:
                readings.append(_reading(run, count))
    return [np.array(readings) for readings in times]


def _reading(run: Callable[[int], None], count: int) -> float:
    began = process_time()
    run(count)
    return (process_time() - began) / count
