"""
planar_chain_sim: planar chains and trees of rigid bodies by Arczewski's path-matrix equations of motion.

`docs/architecture.md` is the map: the rooms, what is in each, and which of them may import which.

Names are loaded when they are first used, so that an executable can set its signal handlers before all imports.
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


# Pickles of version 0.1 name these modules; the names that they need from them are public.
for _former in ('batch', 'body_poses', 'dynamics', 'loads', 'simulation'):
    sys.modules[f'{__name__}.{_former}'] = sys.modules[__name__]


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = globals()[name] = getattr(import_module(f'{__name__}.{_HOME[name]}'), name)
    return value


def __dir__():
    return sorted({*globals(), *_HOME})
