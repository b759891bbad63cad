"""The example controller over real DDS: in lockstep, the bits of the same loop without ROS."""
from live import Peer, Process, run, simulator, stamp_ns
import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.recording.cdr import decode_joint_state
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.ros.example_controller import ComputedTorque

MODULE = 'planar_chain_sim.ros.example_controller'
CHAIN = pcs.load_chain('four_link_robot.yaml')
SETTINGS = {'amplitude': 0.4, 'period': 1.0, 'bandwidth': 20.0}


def seconds_of(stamp):
    """Return a stamp as the controller reads it."""
    return stamp // 10**9 + stamp % 10**9 * 1e-9


def test_it_follows_the_swing_bit_for_bit_as_without_ros(tmp_path):
    path, parameters = tmp_path / 'run.mcap', [f'{name}:={value}' for name, value in SETTINGS.items()]
    with simulator('__ns:=/loop', lockstep=True, record=path) as node, Peer(namespace='/loop') as peer, \
            Process(MODULE, '--ros-args', '-r', '__ns:=/loop', *(part for p in parameters for part in ('-p', p))) \
            as process:
        peer.new_state(lambda state: stamp_ns(state) >= 800_000_000)
        assert process.stop() == 0, process.output
        assert node.stop() == 0, node.output
    states = [decode_joint_state(m.data) for m in read_log(path).messages if m.topic == '/loop/joint_states']
    simulation, controller = pcs.Simulation(CHAIN), ComputedTorque(CHAIN, **SETTINGS)
    for tick in range(700):
        effort, error = controller.effort(seconds_of(tick * 1_000_000), simulation.position, simulation.velocity)
        simulation.advance(1, effort)
        assert states[tick + 1].position.tobytes() == simulation.position.tobytes(), tick
    assert abs(error).max() < 1e-3, 'and it follows: what is left is the efforts that stand for a tick'
    reach = abs(simulation.position - states[0].position).max()
    assert reach > 0.25


@pytest.mark.parametrize('arguments, sentence', [
    (['--ros-args', '-p', 'period:=0.0'], "parameter 'period' is 0.0, must be from 0.01 to 10000"),
    (['--ros-args', '-p', 'chain_file:=none.yaml'], 'none.yaml: was not found in'),
    (['arm'], 'unrecognized arguments: arm (see example_controller --help)')])
def test_mistakes_are_one_sentence(arguments, sentence):
    code, output = run(MODULE, *arguments)
    assert code == 2 and output.startswith('example_controller: ') and sentence in output and '\n' not in output


def test_a_reference_that_begins_at_rest_where_the_arm_is():
    controller = ComputedTorque(CHAIN, **SETTINGS)
    position = np.arange(5.0)
    controller.effort(3.0, position, np.zeros(5))
    wanted, velocity, _ = controller.reference(3.0)
    assert wanted.tolist() == position.tolist() and not velocity.any()
    farthest, _, _ = controller.reference(3.5)
    np.testing.assert_allclose(farthest - position, [0.08, 0.4, 0.4, 0.4, 0.4])


def test_a_controller_alone_says_what_is_missing():
    with Process(MODULE, '--ros-args', '-r', '__ns:=/alone', '-p', 'amplitud:=1.0') as controller:
        controller.wait_for("parameter 'amplitud' is not known and has no effect, did you mean 'amplitude'?")
        controller.wait_for('no joint_states on /alone/joint_states yet')
        controller.wait_for('nobody takes efforts on /alone/simulator/joint_commands')
        assert controller.stop() == 0, controller.output
