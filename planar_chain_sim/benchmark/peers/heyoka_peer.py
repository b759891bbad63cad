"""
heyoka: an adaptive Taylor integrator that LLVM compiles for each system; compile time is not counted.

Measured to be its best options on these problems: unrolled code (compact_mode and slp_vectorize off), high_accuracy
off; the order follows from the tolerance.
"""
from __future__ import annotations

import numpy as np

from . import Curve, half_decades, Run
from .heyoka_expressions import articulated_bodies, System, two_rods
from ..problems import Problem
from ...chain.chain import Chain
from ...chain.joint_arrays import initial_state

FORMULATIONS = {'Taylor, closed form': two_rods, 'Taylor, articulated bodies': articulated_bodies}


class Peer:
    """heyoka's Python package."""

    def __init__(self):
        """Import it; ImportError."""
        import heyoka
        heyoka.set_nthreads(1)   # its compiled functions share states out; idle threads would spin in others' readings
        self.version = heyoka.__version__
        self._heyoka = heyoka

    def formulations(self, chain: Chain) -> dict[str, System]:
        """Return those of FORMULATIONS that fit the chain."""
        systems = {}
        for name, formulation in FORMULATIONS.items():
            try:
                systems[name] = formulation(self._heyoka, chain)
            except ValueError:
                continue
        return systems

    def integrator(self, chain: Chain, formulation: str, tolerance: float) -> tuple:
        """Return heyoka's own integrator at the chain's initial state, and the system that it integrates."""
        system = FORMULATIONS[formulation](self._heyoka, chain)
        start = system.state(*initial_state(chain))
        return self._heyoka.taylor_adaptive(system.equations, start, tol=tolerance), system

    def integration(self, chain: Chain, formulation: str, tolerance: float, duration: float) -> Run:
        """Return an adaptive integration by one of FORMULATIONS."""
        taylor, system = self.integrator(chain, formulation, tolerance)
        start, steps = taylor.state.copy(), [0]

        def go():
            taylor.time = 0.0
            taylor.state[:] = start
            steps[0] = taylor.propagate_until(duration)[3]
        return Run(go, lambda: (system.joints(taylor.state)[0], None, steps[0], 0))

    def curves(self, problem: Problem) -> list[Curve]:
        """Return the curve of every formulation that fits the problem."""
        chain = problem.chain()
        return [Curve('heyoka', name, 'tolerance', half_decades(-1, -17), lambda tolerance, name=name: (
            self.integration(chain, name, tolerance, problem.duration))) for name in self.formulations(chain)]

    def batch_evaluation(self, chain: Chain, formulation: str, position, velocity, effort, fast_math: bool = False):
        """
        Return a function of a count: so many evaluations of all states by a compiled function, vectors over states.

        position, velocity, effort (states, joints); and a function that returns the accelerations (states, joints).
        """
        torque = [self._heyoka.expression(f't{k:02d}') for k in range(chain.joint_count)]
        system = FORMULATIONS[formulation](self._heyoka, chain, torque)
        variables = [variable for variable, _ in system.equations]
        half = len(variables) // 2
        function = self._heyoka.cfunc([side for _, side in system.equations[half:]], variables + torque,
                                      fast_math=fast_math)
        inputs = np.ascontiguousarray(np.vstack([system.to_absolute @ position.T, system.to_absolute @ velocity.T,
                                                 effort.T]))
        outputs = np.empty((half, len(position)))

        def evaluate(count):
            for _ in range(count):
                function(inputs, outputs=outputs)
        return evaluate, lambda: np.linalg.solve(system.to_absolute, outputs).T
