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

__version__ = '0.2.0'

_HOME = {
    'BatchRun': 'batch', 'rollout_batch': 'batch',
    'BodyPoses': 'mechanics.body_poses', 'body_poses': 'mechanics.body_poses',
    'body_velocities': 'mechanics.body_poses', 'center_of_mass': 'mechanics.body_poses',
    'jacobian': 'mechanics.body_poses', 'momentum': 'mechanics.body_poses', 'reaction_forces': 'mechanics.body_poses',
    'BASE': 'tree', 'Body': 'tree', 'Chain': 'chain', 'Joint': 'tree',
    'chain_from_dict': 'chain_file', 'chain_from_text': 'chain_file', 'load_chain': 'chain_file',
    'energy': 'dynamics', 'forward_dynamics': 'dynamics', 'inverse_dynamics': 'dynamics', 'mass_matrix': 'dynamics',
    'equations': 'symbolic.equations',
    'METHODS': 'integrators',
    'linearize': 'linearization',
    'Checkpoint': 'simulation', 'Simulation': 'simulation',
    'Interrupted': 'simulation',
    'ChainError': 'errors', 'SimulationError': 'errors',
    'Run': 'motion.rollout', 'rollout': 'motion.rollout',
    'JointEvent': 'simulation', 'Wrench': 'loads',
    'Log': 'recording.log', 'load_log': 'recording.log', 'LogError': 'errors',
    'OfflineLog': 'recording.offline_log',
    'urdf_of': 'urdf_writer',
}
__all__ = ['__version__', *_HOME]


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = globals()[name] = getattr(import_module(f'{__name__}.{_HOME[name]}'), name)
    return value


def __dir__():
    return sorted({*globals(), *_HOME})
