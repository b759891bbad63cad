"""SciPy's solve_ivp, with this package's compiled evaluation as right-hand side: the fastest it can be given."""
from __future__ import annotations

import numpy as np

from . import Curve, half_decades, Run
from ..problems import Problem
from ...chain.chain import Chain
from ...chain.joint_arrays import initial_state
from ...mechanics.plan import plan_of

METHODS = {'DOP853': -14, 'LSODA': -13, 'Radau': -10}   # and the last decade of tolerance that is worth trying


class Peer:
    """SciPy's Python package."""

    def __init__(self):
        """Import it; ImportError."""
        import scipy.integrate
        self.version = scipy.__version__
        self._solve = scipy.integrate.solve_ivp

    def integration(self, chain: Chain, method: str, tolerance: float, duration: float) -> Run:
        """Return an adaptive integration with rtol = atol = tolerance."""
        model, joints, zero = plan_of(chain).model, chain.joint_count, np.zeros(chain.joint_count)
        start, last = np.concatenate(initial_state(chain)), [None]

        def rate(time, state):
            acceleration, *_ = model.forward_dynamics(state[:joints], state[joints:], zero)
            return np.concatenate([state[joints:], acceleration])

        def go():
            last[0] = self._solve(rate, (0.0, duration), start, method=method, rtol=max(tolerance, 3e-14),
                                  atol=tolerance)

        def end():
            solution = last[0]
            reached = solution.y[:joints, -1] if solution.success else np.full(joints, np.nan)
            return reached, solution.nfev, len(solution.t) - 1, None
        return Run(go, end)

    def curves(self, problem: Problem) -> list[Curve]:
        """Return the curves of METHODS."""
        chain = problem.chain()
        return [Curve('SciPy', method, 'tolerance', half_decades(-2, last), lambda tolerance, method=method: (
            self.integration(chain, method, tolerance, problem.duration))) for method, last in METHODS.items()]
