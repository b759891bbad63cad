"""MuJoCo: mj_forward and its integrators in compiled loops (mujoco.cpp), all off that a scene doesn't need."""
from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np

from . import Curve, Run, steps_of
from .compiled import compile_shared
from ..problems import Problem
from ...chain.chain import Chain
from ...chain.joint_arrays import initial_state

METHODS = ('Euler', 'implicitfast', 'RK4')


def _in_space(vector: complex) -> list[float]:
    return [vector.real, vector.imag, 0.0]


def mujoco_model(chain: Chain, constrained: bool = False):
    """
    Return the chain as an MjModel: hinges about z and slides in the x-y plane, no geometry.

    `constrained`: with its stops and friction, else without any constraint.

    Damping, springs and armature are the joints' own. A slide's axis is in the body's frame there, our carrier's.
    A massless body that only slides is none there: what it carries has its slide too.
    """
    import mujoco
    spec = mujoco.MjSpec()
    spec.compiler.degree = False   # of springref
    spec.option.gravity = _in_space(chain.gravity)
    made, handed = [], {}
    for i, body in enumerate(chain.bodies):
        carrier = spec.worldbody if body.carrier < 0 else made[body.carrier]
        slides = [*handed.get(body.carrier, ()), *([body.slide] if body.slide else ())]
        if _hands_its_slide_on(chain, i):
            handed[i] = slides
            made.append(carrier)
            continue
        part = carrier.add_body(name=body.name, pos=_in_space(body.origin),
                                quat=[np.cos(body.angle / 2), 0.0, 0.0, np.sin(body.angle / 2)])
        part.mass, part.ipos, part.inertia = body.mass, _in_space(body.center_of_mass), [body.inertia_com] * 3
        part.explicitinertial = True
        for slide in slides:
            direction = slide.axis - body.angle
            _add_joint(part, slide, mujoco.mjtJoint.mjJNT_SLIDE, [np.cos(direction), np.sin(direction), 0.0])
        if body.rotation:
            _add_joint(part, body.rotation, mujoco.mjtJoint.mjJNT_HINGE, [0.0, 0.0, body.rotation.axis])
        made.append(part)
    model = spec.compile()
    if constrained:
        return model
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= (
        off.mjDSBL_CONSTRAINT | off.mjDSBL_EQUALITY | off.mjDSBL_FRICTIONLOSS | off.mjDSBL_LIMIT | off.mjDSBL_CONTACT
        | off.mjDSBL_WARMSTART | off.mjDSBL_ACTUATION | off.mjDSBL_SENSOR | off.mjDSBL_AUTORESET | off.mjDSBL_ISLAND)
    if not any(joint.stiffness for joint in chain.joints):
        model.opt.disableflags |= off.mjDSBL_SPRING
    if not any(joint.damping for joint in chain.joints):
        model.opt.disableflags |= off.mjDSBL_DAMPER
    return model


def _hands_its_slide_on(chain: Chain, i: int) -> bool:
    body, carried = chain.bodies[i], [other for other in chain.bodies if other.carrier == i]
    bare = not (body.rotation or body.mass or body.inertia or body.origin or body.angle)
    return body.slide is not None and bare and len(carried) == 1 and not carried[0].origin


def _add_joint(part, joint, kind, axis) -> None:
    made = part.add_joint(name=joint.name, type=kind, axis=axis, armature=joint.armature, damping=joint.damping,
                          stiffness=joint.stiffness, springref=joint.rest, frictionloss=joint.friction)
    if np.isfinite(joint.lower) or np.isfinite(joint.upper):
        made.limited, made.range = 1, [max(joint.lower, -1e6), min(joint.upper, 1e6)]


class Peer:
    """The wheel's library behind compiled loops."""

    def __init__(self):
        """Find header and library in the wheel, compile; Missing."""
        import mujoco
        self.version = mujoco.__version__
        folder = Path(mujoco.__file__).resolve().parent
        libraries = [str(path) for path in folder.glob('libmujoco.so*')]   # loaded already: only its name is needed
        self._library = compile_shared(Path(__file__).with_name('mujoco.cpp'), ['-isystem', str(folder / 'include')],
                                       [*libraries, f'-Wl,-rpath,{folder}'])

    def scene(self, chain: Chain, position, velocity, effort):
        """Return model, data, and the addresses of our joints in MuJoCo's order, which is depth first."""
        import mujoco
        model = mujoco_model(chain)
        data = mujoco.MjData(model)
        address = np.array([model.joint(name).dofadr[0] for name in chain.joint_names])
        data.qpos[address], data.qvel[address], data.qfrc_applied[address] = position, velocity, effort
        return model, data, address

    def forward_dynamics(self, chain: Chain, position, velocity, effort) -> np.ndarray:
        """Return joint accelerations (joints,) by mj_forward: damping and springs act, as ours do."""
        model, data, address = self.scene(chain, position, velocity, effort)
        self._library.evaluate(ctypes.c_void_p(model._address), ctypes.c_void_p(data._address), ctypes.c_long(1))
        return data.qacc[address].copy()

    def evaluation(self, chain: Chain, position, velocity, effort):
        """Return a function of a count: so many calls of mj_forward."""
        model, data, _ = held = self.scene(chain, position, velocity, effort)
        addresses = ctypes.c_void_p(model._address), ctypes.c_void_p(data._address)

        def evaluate(count, held=held):
            self._library.evaluate(*addresses, ctypes.c_long(count))
        return evaluate

    def integration(self, chain: Chain, method: str, step: float, duration: float) -> Run:
        """Return an integration by one of METHODS with a fixed step, s."""
        import mujoco
        start = initial_state(chain)
        model, data, address = self.scene(chain, *start, np.zeros(chain.joint_count))
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f'mjINT_{method.upper()}')
        model.opt.timestep = step
        addresses = ctypes.c_void_p(model._address), ctypes.c_void_p(data._address)
        position, velocity = np.array(start)[:, np.argsort(address)]
        steps = round(duration / step)

        def go():
            data.qpos[:], data.qvel[:] = position, velocity
            self._library.step(*addresses, ctypes.c_long(steps))
        return Run(go, lambda: (data.qpos[address].copy(), steps * (4 if method == 'RK4' else 1), steps, 0))

    def rollout(self, chain: Chain, method: str, position, velocity, step: float, steps: int, threads: int) -> tuple:
        """
        Return a function of a count: so many roll-outs, of `steps` steps, of all states (states, joints).

        And the array (states, steps, 1 + 2 joints) that takes time, position and velocity in MuJoCo's order.
        `threads`: 0 is the calling thread alone.
        """
        import mujoco
        from mujoco import rollout
        model, data, address = self.scene(chain, position[0], velocity[0], np.zeros(chain.joint_count))
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f'mjINT_{method.upper()}')
        model.opt.timestep = step
        order = np.argsort(address)
        start = np.hstack([np.zeros((len(position), 1)), position[:, order], velocity[:, order]])   # time, qpos, qvel
        pool = rollout.Rollout(nthread=threads)
        datas = [data] + [mujoco.MjData(model) for _ in range(threads - 1)]
        states = np.empty((len(position), steps, start.shape[1]))

        def roll(count):
            for _ in range(count):
                pool.rollout(model, datas, start, nstep=steps, state=states)
        return roll, states

    def curves(self, problem: Problem) -> list[Curve]:
        """Return the curves of METHODS; steps that make a scene blow up are left out by their size."""
        chain, duration = problem.chain(), problem.duration
        return [Curve('MuJoCo', method, 'step', steps_of(duration, 200.0),
                      lambda setting, method=method: self.integration(chain, method, setting, duration))
                for method in METHODS]
