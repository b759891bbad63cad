"""Pinocchio: `aba` in a compiled loop, and behind Boost.odeint's integrators (pinocchio.cpp)."""
from __future__ import annotations

import ctypes
from pathlib import Path
import sys

import numpy as np

from . import Curve, half_decades, Run, steps_of
from .compiled import compile_shared, Missing
from ..problems import Problem
from ...chain.chain import Chain
from ...chain.joint_arrays import initial_state

METHODS = ('odeint runge_kutta4', 'odeint dopri5', 'odeint fehlberg78', 'odeint bulirsch_stoer')
# What Pinocchio's own CMake target defines, for its list of 25 joint types.
DEFINITIONS = ('-DBOOST_MPL_LIMIT_LIST_SIZE=30', '-DBOOST_MPL_LIMIT_VECTOR_SIZE=30',
               '-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS', '-DBOOST_FUSION_INVOKE_MAX_ARITY=12')


def _doubles(array: np.ndarray):
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def python_model(chain: Chain):
    """Return the chain as a model of Pinocchio's Python, in the plane z = 0; joints in its order, depth first."""
    import pinocchio

    def in_space(vector: complex) -> np.ndarray:
        return np.array([vector.real, vector.imag, 0.0])

    model = pinocchio.Model()
    model.gravity.linear[:] = in_space(chain.gravity)
    placed, armature = [], []
    for body in chain.bodies:
        joint, frame = placed[body.carrier] if body.carrier >= 0 else (0, pinocchio.SE3.Identity())
        frame = frame * pinocchio.SE3(np.eye(3), in_space(body.origin))
        if body.slide:
            axis = in_space(np.exp(1j * body.slide.axis))
            joint = model.addJoint(joint, pinocchio.JointModelPrismaticUnaligned(axis), frame, body.slide.name)
            frame = pinocchio.SE3.Identity()
            armature.append(body.slide.armature)
        frame = frame * pinocchio.SE3(pinocchio.utils.rotate('z', body.angle), np.zeros(3))
        if body.rotation:
            axis = np.array([0.0, 0.0, body.rotation.axis])
            joint = model.addJoint(joint, pinocchio.JointModelRevoluteUnaligned(axis), frame, body.rotation.name)
            frame = pinocchio.SE3.Identity()
            armature.append(body.rotation.armature)
        inertia = pinocchio.Inertia(body.mass, in_space(body.center_of_mass), body.inertia_com * np.eye(3))
        model.appendBodyToJoint(joint, inertia, frame)
        placed.append((joint, frame))
    model.armature[:] = armature
    return model


class _Model:
    """The C++ side's model and data of one chain, freed with this object: 4 GB at 512 links."""

    def __init__(self, library, *arguments):
        library.make_peer.restype = ctypes.c_void_p
        self._library, self._as_parameter_ = library, ctypes.c_void_p(library.make_peer(*arguments))

    def __del__(self):
        self._library.free_peer(self)


class Peer:
    """Pinocchio's headers compiled as its users compile them."""

    def __init__(self):
        """Find the headers of Pinocchio, Boost and Eigen, compile; Missing."""
        import pinocchio
        self.version = pinocchio.__version__
        marks = {'Pinocchio': 'pinocchio/algorithm/aba.hpp', 'Boost.odeint': 'boost/numeric/odeint.hpp',
                 'Eigen': 'Eigen/Core'}
        places = [parent / 'include' for parent in Path(pinocchio.__file__).resolve().parents]
        places += [Path(entry, 'cmeel.prefix/include') for entry in sys.path]
        places += [Path('/usr/include'), Path('/usr/local/include')]
        flags = list(DEFINITIONS)
        for name, mark in marks.items():
            folder = next((folder for place in places for folder in (place, place / 'eigen3')
                           if (folder / mark).is_file()), None)
            if folder is None:
                raise Missing(f'the headers of {name} are not there (`pip install pin cmeel-eigen` brings them)')
            flags += ['-isystem', str(folder)]
        self._library = compile_shared(Path(__file__).with_name('pinocchio.cpp'), flags)

    def _model(self, chain: Chain) -> _Model:
        """Send a chain to the C++ side."""
        rows = np.array([
            (body.carrier, body.origin.real, body.origin.imag, body.angle, body.mass, body.center_of_mass.real,
             body.center_of_mass.imag, body.inertia_com, body.slide is not None, body.slide.axis if body.slide else 0.0,
             body.rotation.axis if body.rotation else 0.0) for body in chain.bodies], dtype=np.float64)
        laws = np.array([(joint.damping, joint.stiffness, joint.rest, joint.armature) for joint in chain.joints]).T
        laws = np.ascontiguousarray(laws)
        return _Model(self._library, _doubles(rows), len(rows), ctypes.c_double(chain.gravity.real),
                      ctypes.c_double(chain.gravity.imag), _doubles(laws))

    def forward_dynamics(self, chain: Chain, position, velocity, effort) -> np.ndarray:
        """Return joint accelerations (joints,) by `aba`: the effort alone acts, and gravity."""
        acceleration = np.empty(chain.joint_count)
        self._library.evaluate(self._model(chain), *map(_doubles, (position, velocity, effort)), ctypes.c_long(1),
                               _doubles(acceleration))
        return acceleration

    def evaluation(self, chain: Chain, position, velocity, effort):
        """Return a function of a count: so many evaluations of `aba`."""
        model, acceleration = self._model(chain), np.empty(chain.joint_count)
        pointers = [_doubles(array) for array in (position, velocity, effort)]
        held = position, velocity, effort

        def evaluate(count, held=held):
            self._library.evaluate(model, *pointers, ctypes.c_long(count), _doubles(acceleration))
        return evaluate

    def calls(self, chain: Chain, position, velocity, effort) -> dict:
        """Return Pinocchio's calls from Python that answer ours, by our names."""
        import pinocchio
        model = python_model(chain)
        data = model.createData()
        return {'forward_dynamics': lambda: pinocchio.aba(model, data, position, velocity, effort),
                'inverse_dynamics': lambda: pinocchio.rnea(model, data, position, velocity, effort),
                'mass_matrix': lambda: pinocchio.crba(model, data, position),
                'linearize': lambda: pinocchio.computeABADerivatives(model, data, position, velocity, effort)}

    def integration(self, chain: Chain, method: int, setting: float, duration: float) -> Run:
        """Return an integration by METHODS[method]; `setting` is its step, s, or its tolerance."""
        model, start = self._model(chain), np.concatenate(initial_state(chain))
        state, counts = start.copy(), (ctypes.c_long * 3)()
        number = round(duration / setting) if method == 0 else setting

        def go():
            state[:] = start
            self._library.integrate(model, method, ctypes.c_double(number), ctypes.c_double(duration), _doubles(state),
                                    counts)
        return Run(go, lambda: (state[:chain.joint_count], *counts))

    def curves(self, problem: Problem) -> list[Curve]:
        """Return the curves of all METHODS."""
        chain, duration = problem.chain(), problem.duration
        return [Curve('Pinocchio', method, 'tolerance' if k else 'step',
                      half_decades(-2, -17) if k else steps_of(duration),
                      lambda setting, k=k: self.integration(chain, k, setting, duration))
                for k, method in enumerate(METHODS)]
