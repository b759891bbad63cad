"""What the scenes of `benchmark stability` share: a check, small chains, samples of a run, and the same by MuJoCo."""
from __future__ import annotations

from typing import Callable, NamedTuple, Optional, Union

import numpy as np

from ...chain.chain import Chain
from ...chain.tree import Body, Joint
from ...mechanics.dynamics import energy
from ...motion.simulation import Simulation

INTEGRATORS = ('implicitfast', 'RK4')   # of MuJoCo: the one for damping and contacts, and the one for accuracy
REFUSED = 'cannot be built'             # what MuJoCo makes of a body without mass or inertia


class Check(NamedTuple):
    """
    A number that must not exceed `limit`; what MuJoCo makes of the same: a number, a word, None where it is not run.

    `measured` is None where the check could not be run, and `why` says why.
    """

    what: str
    limit: float
    measured: Optional[float]
    mujoco: Union[float, str, None] = None
    why: str = ''

    @property
    def holds(self) -> str:
        """Return 'yes', 'NO', or why it was not run."""
        if self.measured is None:
            return f'not run: {self.why}'
        return 'yes' if self.measured <= self.limit else 'NO'   # what is no number does not hold


def one_joint(kind: str = 'rotation', gravity: complex = -10j, **laws) -> Chain:
    """Return 1 kg and 1 kg m^2 on a hinge, its weight of 10 N at 0.5 m across; or 1 kg on an upright slide."""
    upright = kind == 'slide'
    joint = Joint('joint', kind, np.pi / 2 if upright else 1.0, **laws)
    center = 0j if upright else 0.5 + 0j
    return Chain('one', gravity, (Body('body', -1, 0j, 0.0, 1.0, center, 1.0, 1.0 - abs(center)**2,
                                       joint if upright else None, None if upright else joint),))


def total_energy(simulation: Simulation) -> float:
    """Return kinetic and potential energy now, J."""
    return sum(energy(simulation.chain, simulation.position, simulation.velocity))


def energies(chain: Chain, states) -> np.ndarray:
    """Return energies, J, one for each of states (samples, 2, joints)."""
    return np.array([sum(energy(chain, *state)) for state in states])


def sampled(simulation: Simulation, count: int, ticks: int = 1, effort=None) -> np.ndarray:
    """Go on `count` times by `ticks`; return positions and velocities (count + 1, 2, joints), present ones first."""
    states = [(simulation.position, simulation.velocity)]
    for _ in range(count):
        simulation.advance(ticks, effort)
        states.append((simulation.position, simulation.velocity))
    return np.array(states)


def largest_rise(values: np.ndarray) -> float:
    """Return the largest step up from one value to the next."""
    return float(np.diff(values).max())


class MuJoCoRun:
    """The chain in MuJoCo, with its stops and friction as MuJoCo has them by default; what it warns of is counted."""

    def __init__(self, chain: Chain, step: float, integrator: str = 'implicitfast'):
        import mujoco

        from ..peers.mujoco_peer import mujoco_model
        mujoco.set_mju_user_warning(lambda text: None)   # else it writes a file where one stands
        self._mujoco, self._model = mujoco, mujoco_model(chain, constrained=True)
        self._model.opt.integrator = getattr(mujoco.mjtIntegrator, f'mjINT_{integrator.upper()}')
        self._model.opt.timestep = step
        self._data = mujoco.MjData(self._model)
        self._address = np.array([self._model.joint(name).dofadr[0] for name in chain.joint_names])
        self.set_state([joint.position for joint in chain.joints], [joint.velocity for joint in chain.joints])

    def set_state(self, position, velocity) -> None:
        """Put joint positions and velocities (joints,)."""
        self._data.qpos[self._address], self._data.qvel[self._address] = position, velocity

    @property
    def state(self) -> np.ndarray:
        """Positions and velocities (2, joints)."""
        return np.array([self._data.qpos[self._address], self._data.qvel[self._address]])

    @property
    def resets(self) -> int:
        """How often it met values that are not finite, or huge, and put everything back to the start."""
        kinds = self._mujoco.mjtWarning
        return sum(int(self._data.warning[kind].number)
                   for kind in (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC))

    def advance(self, ticks: int, effort=0.0) -> None:
        """Go on under efforts (joints,) or one for all."""
        self._data.qfrc_applied[self._address] = effort
        self._mujoco.mj_step(self._model, self._data, nstep=ticks)

    def sampled(self, count: int, ticks: int = 1) -> np.ndarray:
        """Go on `count` times by `ticks`; return states (count + 1, 2, joints), the present one first."""
        states = [self.state]
        for _ in range(count):
            self.advance(ticks)
            states.append(self.state)
        return np.array(states)


def by_mujoco(peers: dict, chain: Chain, step: float, measure: Callable[[MuJoCoRun], float]) -> Optional[float]:
    """Return the least of `measure(run)` over INTEGRATORS, inf where it is no number; None where there is no MuJoCo."""
    if 'MuJoCo' not in peers:
        return None
    found = [float(measure(MuJoCoRun(chain, step, integrator))) for integrator in INTEGRATORS]
    return min(value if np.isfinite(value) else np.inf for value in found)
