"""
planar_chain_sim: planar chains and trees of rigid bodies by Arczewski's path-matrix equations of motion.

The map: data in `chain`, its numbers by name in `chain_parameters`, files of it in `chain_file`, what is refused in
`chain_section` and `chain_checks`; topology S, P, M, with (5.60), in `path_matrix`; (5.87) and (5.88) in
`equations_of_motion`; laws of joint effort in `joint_forces`; energy, (5.65) and (5.72), in `invariants`; the O(n)
recursion in `kernel/forms/recursive.hpp`, prepared by `plan` and called by `dynamics`; poses, momentum and reaction
forces in `body_poses`; methods in `integrators`, their coefficients in `tableaux`; derivatives of the equations in
`kernel/forms/jacobian.hpp`, called by `linearization`; the same equations term by term in `symbolic`; stops and dry
friction in `kernel/events/events.hpp` and `kernel/events/holding.hpp`; wrenches and payloads in `loads`; numbers of a
chain that may change in `quantities`; time in `simulation`; how a long call is stopped in
`kernel/integrators/lookout.hpp` and `kernel/python/turn.hpp`; logs in `recording`; everything that needs ROS in `ros`.

Names are loaded when first used, so that an executable's first statement can be its signal handlers.
"""
from importlib import import_module
import sys

__version__ = '0.2.0'

_HOME = {name: module for module, names in {   # public name -> its module
    'chain.chain': 'Chain',
    'chain.tree': 'BASE Body Joint',
    'chain_file': 'chain_from_dict chain_from_text load_chain',
    'errors': 'ChainError LogError SimulationError',
    'mechanics.body_poses': 'BodyPoses body_poses body_velocities center_of_mass jacobian momentum reaction_forces',
    'mechanics.dynamics': 'energy forward_dynamics inverse_dynamics mass_matrix',
    'mechanics.linearization': 'linearize',
    'mechanics.loads': 'Wrench',
    'motion.batch': 'BatchRun rollout_batch',
    'motion.integrators': 'METHODS',
    'motion.rollout': 'Run rollout',
    'motion.simulation': 'Checkpoint Interrupted JointEvent Simulation',
    'recording.log': 'Log load_log',
    'recording.offline_log': 'OfflineLog',
    'robot_files.urdf_writer': 'urdf_of',
    'symbolic.equations': 'equations',
}.items() for name in names.split()}
__all__ = ['__version__', *_HOME]


# Pickles of version 0.1 name these modules; what they look for there is public.
for _former in ('batch', 'body_poses', 'dynamics', 'loads', 'simulation'):
    sys.modules[f'{__name__}.{_former}'] = sys.modules[__name__]


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = globals()[name] = getattr(import_module(f'{__name__}.{_HOME[name]}'), name)
    return value


def __dir__():
    return sorted({*globals(), *_HOME})
