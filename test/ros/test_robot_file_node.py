"""The node with a robot file: it lists the joints, holds joints, and publishes the URDF of what moves."""
from xml.etree import ElementTree

from live import Peer, Process, run, simulator
import numpy as np
from oracles.robot_arm import YAWING
import pytest
from std_msgs.msg import String

from planar_chain_sim import forward_dynamics, load_chain


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / 'robot.urdf'
    path.write_text(YAWING.replace('effort="9"', 'effort="0"'))
    return path


def moving_joints(text):
    joints = ElementTree.fromstring(text).findall('joint')
    return [joint.get('name') for joint in joints if joint.get('type') != 'fixed']


@pytest.mark.parametrize('way', ['argument', 'parameter', 'one text'])
def test_held_joints(way, robot, tmp_path):
    """The states are those of the arm that is left, from the first on, and so is the URDF."""
    arguments = {'argument': [robot, '--hold', 's=0.7'], 'parameter': [robot, '--ros-args', '-p', 'hold:=["s=0.7"]'],
                 'one text': [robot, '--ros-args', '-p', 'hold:=s=0.7']}[way]
    arguments += ['--ros-args', '-p', f'record:={tmp_path / "run.mcap"}']
    with Process('planar_chain_sim.ros.node', *arguments) as process, Peer() as peer:
        texts = peer.listen(String, '/robot_description', latched=True)
        peer.meet()
        state = peer.new_state()
        assert list(state.name) == ['e', 'w']
        peer.until(lambda: texts, 'a description')
        assert moving_joints(texts[0].data) == ['e', 'w']
        assert process.stop() == 0, process.output
    note = next(line for line in process.lines if 'plane with x along' in line)
    assert '[INFO]' in note and f"{robot}: joints 'e', 'w'" in note and "welded: 's' at 0.7" in note
    assert len([line for line in process.lines if '[WARN]' in line and 'effort limit 0' in line]) == 1
    code, output = run('planar_chain_sim.resimulation.command_line', tmp_path / 'run.mcap')
    assert code == 0, output


def test_the_given_robot_is_published_if_nothing_is_welded(robot):
    text = robot.read_text().replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>')
    robot.write_text(text)
    with simulator(chain_file=robot) as process, Peer() as peer:
        texts = peer.listen(String, '/robot_description', latched=True)
        peer.meet()
        peer.until(lambda: texts, 'a description')
        assert texts[0].data == text
        assert process.stop() == 0, process.output


@pytest.mark.parametrize('parts, said', [
    ([], "joint 's' turns about another direction than 'e', 'w'"),
    (['--hold', 'base'], "hold names 'base', which the robot does not have"),
    (['--ros-args', '-p', 'hold:=[1, 2]'], "parameter 'hold' is [1, 2], must be a list of strings"),
])
def test_a_mistake_is_one_sentence(parts, said, robot):
    code, output = run('planar_chain_sim.ros.node', robot, *parts)
    assert code == 2 and said in output and 'Traceback' not in output


def test_the_example_controller_holds_the_same_joints(robot):
    """In lockstep at the simulator's own pace: the states come back, so its commands are of the right joints."""
    hold = ['--ros-args', '-p', 'hold:=[s]']
    with Process('planar_chain_sim.ros.node', robot, *hold, '-p', 'lockstep:=true') as process, \
            Process('planar_chain_sim.ros.example_controller', *hold, '-p', f'chain_file:={robot}') as controller, \
            Peer() as peer:
        peer.meet()
        state = peer.new_state(lambda state: state.header.stamp.sec >= 1)
        chain = load_chain(robot, hold=['s'])
        assert np.isfinite(forward_dynamics(chain, state.position, state.velocity, state.effort)).all()
        assert any(state.effort)
        assert controller.stop() == 0 and process.stop() == 0, process.output
