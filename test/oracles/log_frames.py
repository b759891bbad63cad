"""The frames in a log with record_tf, decoded by rosbags and chained up to `world` here, against body_poses."""
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

import planar_chain_sim as pcs


def in_world(transforms):
    """Return child -> (rotation, position) in the frame `world`; transforms: those of a state, by child."""
    places = {'world': (np.eye(3), np.zeros(3))}

    def place(child):
        if child not in places:
            transform = transforms[child]
            turn, shift = place(transform.header.frame_id)
            v, q = transform.transform.translation, transform.transform.rotation
            x, y, z, w = q.x, q.y, q.z, q.w
            assert x*x + y*y + z*z + w*w == pytest.approx(1.0, abs=1e-12)
            own = np.array([[1 - 2 * (y*y + z*z), 2 * (x*y - w*z), 2 * (x*z + w*y)],
                            [2 * (x*y + w*z), 1 - 2 * (x*x + z*z), 2 * (y*z - w*x)],
                            [2 * (x*z - w*y), 2 * (y*z + w*x), 1 - 2 * (x*x + y*y)]])
            places[child] = turn @ own, shift + turn @ np.array([v.x, v.y, v.z])
        return places[child]
    return {child: place(child) for child in transforms}


def check_frames(path, chain):
    """Compare the frames of /tf and /tf_static, chained up to `world`, with body_poses; return its stamps, ns."""
    positions, stamps, fixed = {}, [], {}
    with AnyReader([Path(path)]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.msgtype == 'sensor_msgs/msg/JointState':
                positions[message.header.stamp.sec * 10**9 + message.header.stamp.nanosec] = message.position
            elif connection.topic == '/tf_static':
                fixed = {transform.child_frame_id: transform for transform in message.transforms}
            elif connection.topic == '/tf':
                stamp, = {t.header.stamp.sec * 10**9 + t.header.stamp.nanosec for t in message.transforms}
                places = in_world({**fixed, **{t.child_frame_id: t for t in message.transforms}})
                poses = pcs.body_poses(chain, positions[stamp])   # of the state before it in the file
                for body, point, angle in zip(chain.bodies, poses.point, poses.angle):
                    turn, shift = places[body.name]
                    np.testing.assert_allclose(shift, [point[0], 0.0, point[1]], atol=1e-12)
                    np.testing.assert_allclose(turn[:, 0], [np.cos(angle), 0.0, np.sin(angle)], atol=1e-12)
                    np.testing.assert_allclose(turn[:, 2], [0.0, -1.0, 0.0], atol=1e-12)
                stamps.append(stamp)
    return stamps
