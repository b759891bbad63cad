"""The table of parameters against what ROS makes of a command line; each node here is a real one."""
import pytest
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from planar_chain_sim import load_chain
from planar_chain_sim.command_line import Mistake
from planar_chain_sim.ros.declaration import declare_chain_parameters, declare_parameters, let_set
from planar_chain_sim.ros.parameters import PARAMETERS


CHAIN = load_chain('double_pendulum.yaml')
JOINTS = list(CHAIN.joint_names)


@pytest.fixture(scope='module')
def context():
    context = rclpy.Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    yield context
    context.try_shutdown()


@pytest.fixture
def declared(context):
    """Return a function that declares the table under parameters of a command line; it gives (values, node)."""
    nodes = []

    def declare(*parameters):
        arguments = ['--ros-args', *(part for parameter in parameters for part in ('-p', parameter))]
        nodes.append(Node('simulator', context=context, cli_args=arguments, start_parameter_services=False))
        return declare_parameters(nodes[-1]), nodes[-1]
    yield declare
    for node in nodes:
        node.destroy_node()


def test_defaults(declared):
    values, node = declared()
    assert values == {**{row.name: row.default for row in PARAMETERS if not row.of_chain}, 'publish_rate': 1000.0}
    assert values['rate'] == 1000.0 and values['chain_file'] == 'four_link_robot.yaml'
    assert values['on_controller_loss'] == 'zero' and values['record'] == ''


def test_every_parameter_is_described_and_read_only_where_no_change_acts(declared):
    _, node = declared('rate:=500.0')
    declare_chain_parameters(node, CHAIN)
    for row in PARAMETERS:
        descriptor = node.describe_parameter(row.name)
        assert descriptor.description.startswith(row.description) and row.unit in descriptor.description
        assert descriptor.read_only != row.live
        assert descriptor.type == node.get_parameter(row.name).type_.value == Parameter.Type[row.type].value
        if row.limits and row.type == 'DOUBLE':
            limits, = descriptor.floating_point_range
            assert (limits.from_value, limits.to_value) == row.limits
    outcome, = node.set_parameters([Parameter('rate', value=100.0)])
    assert not outcome.successful
    assert node.get_parameter('rate').value == 500.0


def test_whole_numbers_are_taken_where_numbers_are_meant(declared):
    values, node = declared('rate:=500', 'publish_rate:=100', 'real_time_factor:=2')
    assert (values['rate'], values['publish_rate'], values['real_time_factor']) == (500.0, 100.0, 2.0)
    assert type(values['rate']) is float
    assert node.get_parameter('rate').type_ == Parameter.Type.DOUBLE


@pytest.mark.parametrize('parameter, sentence', [
    ('rate:=-5', "parameter 'rate' is -5.0, must be from 1 to 100000"),
    ('rate:=0.5', "parameter 'rate' is 0.5, must be from 1 to 100000"),
    ('rate:=.nan', "parameter 'rate' is nan, must be from 1 to 100000"),
    ('rate:=fast', "parameter 'rate' is 'fast', must be a number"),
    ('rate:=true', "parameter 'rate' is True, must be a number"),
    ('publish_rate:=300', "parameter 'publish_rate' is 300.0, must be 0 or `rate` (1000.0) divided by a whole number"),
    ('publish_rate:=2e3', "parameter 'publish_rate' is 2000.0, must be 0 or `rate` (1000.0) divided by a whole number"),
    ('real_time_factor:=-1', "parameter 'real_time_factor' is -1.0, must be from 0 to 1000"),
    ('tolerance:=2', "parameter 'tolerance' is 2.0, must be from 0 to 1"),
    ('command_timeout:=-0.1', "parameter 'command_timeout' is -0.1, must be from 0 to 1e+06"),
    ('lockstep:=1', "parameter 'lockstep' is 1, must be true or false"),
    ('start_paused:=1', "parameter 'start_paused' is 1, must be true or false"),
    ('chain_file:=7', "parameter 'chain_file' is 7, must be a text"),
    ('frame_id:=[a,b]', "parameter 'frame_id' is ['a', 'b'], must be a text"),
    ('on_controller_loss:=stop', "parameter 'on_controller_loss' is 'stop', must be one of 'zero', 'hold'"),
    ('record_flush_period:=0.0', "parameter 'record_flush_period' is 0.0, must be from 0.01 to 3600"),
    ('record_compression:=zip', "parameter 'record_compression' is 'zip', must be one of 'none', 'lz4', 'zstd'")])
def test_a_bad_value_is_one_sentence(declared, parameter, sentence):
    with pytest.raises(Mistake) as mistake:
        declared(parameter)
    assert str(mistake.value) == sentence


def test_a_slip_in_a_name_is_told(declared, capfd):
    declared('rat:=5.0', 'something_else_of_a_shared_file:=3')
    told = capfd.readouterr().err
    assert "parameter 'rat' is not known and has no effect, did you mean 'rate'?" in told
    assert 'something_else' not in told


def test_the_chain_gives_defaults_and_only_what_was_given_is_returned(declared):
    _, node = declared('gravity:=[0,-5]', 'effort_limit:=[.inf, 3.0]')
    assert declare_chain_parameters(node, CHAIN) == {
        'gravity': [0.0, -5.0], 'effort_limit': [float('inf'), 3.0], 'lockstep_joints': JOINTS,
        'commanded_joints': [], 'payload_body': CHAIN.bodies[-1].name, 'payload_position': [0.0, 0.0]}
    assert list(node.get_parameter('damping').value) == [joint.damping for joint in CHAIN.joints]
    assert list(node.get_parameter('gravity').value) == [0.0, -5.0]


@pytest.mark.parametrize('parameter, sentence', [
    ('gravity:=[1.0]', "parameter 'gravity' has 1 values, must have 2 (m/s^2, [x, y])"),
    ('gravity:=9.81', "parameter 'gravity' is 9.81, must be a list of numbers"),
    ('gravity:=[.nan, 1.0]', "parameter 'gravity' is nan in one place, must be finite numbers (m/s^2, [x, y])"),
    ('damping:=[-1.0, 1.0]', "parameter 'damping' is -1.0 in one place, must be finite numbers >= 0 "
     '(N m s/rad or N s/m, in joint order)'),
    ('effort_limit:=[a, b]', "parameter 'effort_limit' is ['a', 'b'], must be a list of numbers"),
    ('payload_position:=[1.0]', "parameter 'payload_position' is [1.0], must be two numbers, [x, y]"),
    ('payload_position:=[.inf, 0.0]',
     "parameter 'payload_position' is [inf, 0.0], must be numbers from -1e+06 to 1e+06"),
    ('payload_body:=hand', "parameter 'payload_body' is 'hand', must be a body of the chain: "
     f'{", ".join(body.name for body in CHAIN.bodies)}'),
    ('lockstep_joints:=[elbow]', "parameter 'lockstep_joints' names 'elbow', must name joints of the chain: "
     + ', '.join(JOINTS))])
def test_a_bad_value_for_the_chain_is_one_sentence(declared, parameter, sentence):
    _, node = declared(parameter)
    with pytest.raises(Mistake) as mistake:
        declare_chain_parameters(node, CHAIN)
    assert str(mistake.value) == sentence


def test_live_parameters_are_converted_checked_and_applied_all_or_none(declared):
    _, node = declared()
    declare_chain_parameters(node, CHAIN)
    applied = []
    let_set(node, CHAIN, lambda values: (applied.append(values) or True, ''))
    results = node.set_parameters([Parameter('gravity', value=[0, -2]), Parameter('real_time_factor', value=2)])
    assert all(result.successful for result in results), results
    assert applied == [{'gravity': [0.0, -2.0]}, {'real_time_factor': 2.0}]
    assert node.get_parameter('gravity').type_ == Parameter.Type.DOUBLE_ARRAY
    outcome = node.set_parameters_atomically([Parameter('gravity', value=[1.0, 1.0]),
                                              Parameter('damping', value=[1.0, -1.0])])
    assert not outcome.successful and 'must be finite numbers >= 0' in outcome.reason
    assert len(applied) == 2 and list(node.get_parameter('gravity').value) == [0.0, -2.0]
    for name, value in (('on_controller_loss', 'stop'), ('gravity', [1.0]), ('gravity', 'down'), ('rate', 5.0)):
        assert not node.set_parameters([Parameter(name, value=value)])[0].successful
    assert len(applied) == 2


def test_what_the_simulator_refuses_is_not_set(declared):
    _, node = declared()
    declare_chain_parameters(node, CHAIN)
    let_set(node, CHAIN, lambda values: (False, 'no'))
    outcome, = node.set_parameters([Parameter('command_timeout', value=1.0)])
    assert not outcome.successful and outcome.reason == 'no'
    assert node.get_parameter('command_timeout').value == 0.0
