"""URDF texts of random planar robots, mounted anyhow in space, and what Pinocchio and MuJoCo make of such a text."""
import mujoco
import numpy as np
import pinocchio

from planar_chain_sim.robot_files.spatial_robot import turn_about


def direction(random) -> np.ndarray:
    """Return a random unit vector."""
    vector = random.normal(size=3)
    return vector / np.linalg.norm(vector)


def rpy_of(turn) -> tuple:
    """Return roll, pitch, yaw of a rotation matrix."""
    pitch = np.arctan2(-turn[2, 0], np.hypot(turn[0, 0], turn[1, 0]))
    return np.arctan2(turn[2, 1], turn[2, 2]), pitch, np.arctan2(turn[1, 0], turn[0, 0])


def row(values) -> str:
    return ' '.join(repr(float(value)) for value in values)


def inertial(random) -> str:
    """Return the inertial of a few random points: turned anyhow, with products of inertia, off the plane."""
    points = random.normal(scale=0.2, size=(5, 3))
    matrix = sum(np.eye(3) * (point @ point) - np.outer(point, point) for point in points)
    xx, yy, zz, xy, xz, yz = (float(matrix[i, k]) for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return (f'<inertial><origin xyz="{row(random.normal(scale=0.3, size=3))}" rpy="{row(random.normal(size=3))}"/>'
            f'<mass value="{random.uniform(0.2, 3.0)}"/><inertia ixx="{xx!r}" iyy="{yy!r}" izz="{zz!r}" ixy="{xy!r}" '
            f'ixz="{xz!r}" iyz="{yz!r}"/></inertial>')


def random_robot(seed: int, normal=None, lengthwise: float = 0.0, askew: float = 0.0, most: int = 7) -> str:
    """
    Return a URDF text: a tree of up to `most` links behind a root that is mounted anyhow.

    `normal`: of the plane, in the world; random if not given. `lengthwise`: the share of slides that go along it.
    `askew`: rad, by which the axes of rotations are off.
    """
    random = np.random.default_rng(seed)
    normal = direction(random) if normal is None else np.asarray(normal, float) / np.linalg.norm(normal)
    turns = [np.eye(3)]
    text = ['<robot name="random"><link name="l0"/>']
    count = int(random.integers(2, most + 1))
    for k in range(1, count):
        parent = int(random.integers(max(0, k - 2), k))
        kind = str(random.choice(['continuous', 'continuous', 'prismatic', 'fixed'])) if k < count - 1 else 'continuous'
        turn = turn_about(direction(random), random.uniform(-3.0, 3.0))
        turns.append(turn)
        axis = normal * random.choice([-1.0, 1.0])
        if kind == 'continuous' and askew:
            axis = turn_about(direction(random), askew) @ axis
        if kind == 'prismatic' and random.random() >= lengthwise:
            axis = np.cross(normal, direction(random))
        text.append(f'<link name="l{k}">{inertial(random)}</link><joint name="j{k}" type="{kind}">'
                    f'<parent link="l{parent}"/><child link="l{k}"/>'
                    f'<origin xyz="{row(random.normal(scale=0.5, size=3))}" '
                    f'rpy="{row(rpy_of(turns[parent].T @ turn))}"/>'
                    f'<axis xyz="{row(turn.T @ axis * random.uniform(0.5, 2.0))}"/>'
                    '<limit effort="1e3" velocity="1e9" lower="-1e9" upper="1e9"/></joint>')
    return ''.join(text) + '</robot>'


def by_pinocchio(text: str, names, position, velocity, effort, hold=None) -> np.ndarray:
    """Return the accelerations of the joints of these names, in their order; `hold`: joint -> value at which it is."""
    model = pinocchio.buildModelFromXML(text)
    if hold:
        q = pinocchio.neutral(model)
        for name, value in hold.items():
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q:joint.idx_q + joint.nq] = (np.cos(value), np.sin(value)) if joint.nq == 2 else value
        model = pinocchio.buildReducedModel(model, [model.getJointId(name) for name in hold], q)
    data = model.createData()
    q, v, tau = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    joints = [model.joints[model.getJointId(name)] for name in names]
    assert len(joints) == model.nv
    for joint, place, rate, u in zip(joints, position, velocity, effort):
        q[joint.idx_q:joint.idx_q + joint.nq] = (np.cos(place), np.sin(place)) if joint.nq == 2 else place
        v[joint.idx_v], tau[joint.idx_v] = rate, u
    return pinocchio.aba(model, data, q, v, tau)[[joint.idx_v for joint in joints]]


def by_mujoco(text: str, names, position, velocity, effort) -> np.ndarray:
    """Return the same by MuJoCo."""
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    data = mujoco.MjData(model)
    joints = [model.joint(name) for name in names]
    assert len(joints) == model.nv
    for joint, place, rate, u in zip(joints, position, velocity, effort):
        data.qpos[joint.qposadr], data.qvel[joint.dofadr], data.qfrc_applied[joint.dofadr] = place, rate, u
    mujoco.mj_forward(model, data)
    return np.array([data.qacc[joint.dofadr[0]] for joint in joints])
