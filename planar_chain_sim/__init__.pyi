# The public names with their types: planar_chain_sim loads each when it is first used, which a type checker cannot see.
from .chain.chain import Chain as Chain
from .chain.tree import BASE as BASE, Body as Body, Joint as Joint
from .chain_file import chain_from_dict as chain_from_dict, chain_from_text as chain_from_text, load_chain as load_chain
from .errors import ChainError as ChainError, LogError as LogError, SimulationError as SimulationError
from .mechanics.body_poses import (
    body_poses as body_poses,
    body_velocities as body_velocities,
    BodyPoses as BodyPoses,
    center_of_mass as center_of_mass,
    jacobian as jacobian,
    momentum as momentum,
    reaction_forces as reaction_forces,
)
from .mechanics.dynamics import (
    energy as energy,
    forward_dynamics as forward_dynamics,
    inverse_dynamics as inverse_dynamics,
    mass_matrix as mass_matrix,
)
from .mechanics.linearization import linearize as linearize
from .mechanics.loads import Wrench as Wrench
from .motion.batch import BatchRun as BatchRun, rollout_batch as rollout_batch
from .motion.integrators import METHODS as METHODS
from .motion.rollout import rollout as rollout, Run as Run
from .motion.simulation import (
    Checkpoint as Checkpoint,
    Interrupted as Interrupted,
    JointEvent as JointEvent,
    Simulation as Simulation,
)
from .recording.log import load_log as load_log, Log as Log
from .recording.offline_log import OfflineLog as OfflineLog
from .robot_files.urdf_writer import urdf_of as urdf_of
from .symbolic.equations import equations as equations

__version__: str
