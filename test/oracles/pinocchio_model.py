"""A chain as a model of Pinocchio, built joint by joint."""
import numpy as np


def spring_and_damper(chain, position, velocity):
    return np.array([-joint.damping * v - joint.stiffness * (q - joint.rest)
                     for joint, q, v in zip(chain.joints, position, velocity)])


def in_space(vector):
    return np.array([vector.real, vector.imag, 0.0])


def pinocchio_model(pin, chain):
    model = pin.Model()
    model.gravity.linear[:] = in_space(chain.gravity)
    placed, armature = [], []
    for body in chain.bodies:
        joint, frame = placed[body.carrier] if body.carrier >= 0 else (0, pin.SE3.Identity())
        frame = frame * pin.SE3(np.eye(3), in_space(body.origin))
        if body.slide:
            axis = in_space(np.exp(1j * body.slide.axis))
            joint = model.addJoint(joint, pin.JointModelPrismaticUnaligned(axis), frame, body.slide.name)
            frame = pin.SE3.Identity()
            armature.append(body.slide.armature)
        frame = frame * pin.SE3(pin.utils.rotate('z', body.angle), np.zeros(3))
        if body.rotation:
            axis = np.array([0.0, 0.0, body.rotation.axis])
            joint = model.addJoint(joint, pin.JointModelRevoluteUnaligned(axis), frame, body.rotation.name)
            frame = pin.SE3.Identity()
            armature.append(body.rotation.armature)
        inertia = pin.Inertia(body.mass, in_space(body.center_of_mass), body.inertia_com * np.eye(3))
        model.appendBodyToJoint(joint, inertia, frame)
        placed.append((joint, frame))
    model.armature[:] = armature
    return model
