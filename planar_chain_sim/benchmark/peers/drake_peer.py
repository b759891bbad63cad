"""Drake: a continuous MultibodyPlant under its error-controlled integrators; everything but the call runs in C++."""
from __future__ import annotations

import numpy as np

from . import Curve, half_decades, Run
from ..problems import Problem
from ...chain.chain import Chain
from ...chain.joint_arrays import initial_state

LONGEST_STEP = 0.1   # s: without a bound some runs never end
METHODS = ('runge_kutta3', 'runge_kutta5')


def _in_space(vector: complex) -> list[float]:
    return [vector.real, vector.imag, 0.0]


def drake_plant(chain: Chain):
    """Return the chain as a finalized continuous plant, its joints in our order; ValueError: armature."""
    from pydrake.math import RigidTransform, RollPitchYaw
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import (
        FixedOffsetFrame,
        PrismaticJoint,
        PrismaticSpring,
        RevoluteJoint,
        RevoluteSpring,
        RotationalInertia,
        SpatialInertia,
    )
    if any(joint.armature for joint in chain.joints):
        raise ValueError(f'{chain.name}: armature is not passed on')
    plant = MultibodyPlant(time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector(_in_space(chain.gravity))

    frames, joints = [], []
    for body in chain.bodies:
        carrier = plant.world_frame() if body.carrier < 0 else frames[body.carrier]
        frame = plant.AddFrame(FixedOffsetFrame(f'{body.name}_origin', carrier, RigidTransform(_in_space(body.origin))))
        turn = RigidTransform(RollPitchYaw(0.0, 0.0, body.angle), [0.0, 0.0, 0.0])
        spin = RotationalInertia(*[body.inertia_com] * 3)   # as a ball's: only the part about z is ever asked
        made = plant.AddRigidBody(body.name, SpatialInertia.MakeFromCentralInertia(
            body.mass, _in_space(body.center_of_mass), spin))
        if body.slide:
            slider = plant.AddRigidBody(f'{body.name}_slider', SpatialInertia.Zero())
            axis = _in_space(np.exp(1j * body.slide.axis))
            joints.append(plant.AddJoint(PrismaticJoint(body.slide.name, frame, slider.body_frame(), axis,
                                                        damping=body.slide.damping)))
            if body.slide.stiffness:
                plant.AddForceElement(PrismaticSpring(joints[-1], body.slide.rest, body.slide.stiffness))
            frame = slider.body_frame()
        frame = plant.AddFrame(FixedOffsetFrame(f'{body.name}_turn', frame, turn))
        if body.rotation:
            joints.append(plant.AddJoint(RevoluteJoint(
                body.rotation.name, frame, made.body_frame(), [0.0, 0.0, body.rotation.axis],
                damping=body.rotation.damping)))
            if body.rotation.stiffness:
                plant.AddForceElement(RevoluteSpring(joints[-1], body.rotation.rest, body.rotation.stiffness))
        else:
            plant.WeldFrames(frame, made.body_frame())
        frames.append(made.body_frame())
    plant.Finalize()
    return plant, joints


class Peer:
    """Drake's Python package."""

    def __init__(self):
        """Import it; ImportError."""
        from importlib.metadata import version

        import pydrake.all  # noqa: F401
        self.version = version('drake')

    def forward_dynamics(self, chain: Chain, position, velocity, effort) -> np.ndarray:
        """Return joint accelerations (joints,), damping and springs included."""
        plant, joints = drake_plant(chain)
        context = plant.CreateDefaultContext()
        _place(plant, joints, context, position, velocity)
        forces = np.empty(chain.joint_count)
        forces[[joint.velocity_start() for joint in joints]] = effort
        plant.get_applied_generalized_force_input_port().FixValue(context, forces)
        rates = plant.EvalTimeDerivatives(context).CopyToVector()[plant.num_positions():]
        return rates[[joint.velocity_start() for joint in joints]]

    def integration(self, chain: Chain, method: str, accuracy: float, duration: float) -> Run:
        """Return an integration with error control to `accuracy`."""
        from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
        plant, joints = drake_plant(chain)
        simulator = Simulator(plant)
        context = simulator.get_mutable_context()
        ResetIntegratorFromFlags(simulator, method, LONGEST_STEP)
        integrator = simulator.get_mutable_integrator()
        start = initial_state(chain)
        order = [joint.position_start() for joint in joints]

        def go():
            context.SetTime(0.0)
            _place(plant, joints, context, *start)
            integrator.Reset()                # else a run begins with the last one's step
            integrator.set_maximum_step_size(LONGEST_STEP)
            integrator.set_target_accuracy(accuracy)
            simulator.Initialize()
            simulator.AdvanceTo(duration)

        def end():
            return (plant.GetPositions(context)[order], integrator.get_num_derivative_evaluations(),
                    integrator.get_num_steps_taken(), integrator.get_num_step_shrinkages_from_error_control())
        return Run(go, end)

    def curves(self, problem: Problem) -> list[Curve]:
        """Return the curves of METHODS."""
        chain = problem.chain()
        return [Curve('Drake', method, 'tolerance', half_decades(-2, -14), lambda accuracy, method=method: (
            self.integration(chain, method, accuracy, problem.duration))) for method in METHODS]


def _place(plant, joints, context, position, velocity) -> None:
    q, v = np.empty(len(joints)), np.empty(len(joints))
    for joint, place, rate in zip(joints, position, velocity):
        q[joint.position_start()], v[joint.velocity_start()] = place, rate
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
