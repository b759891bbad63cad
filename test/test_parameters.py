"""The table of parameters against what ROS makes of a command line; each node here is a real one."""
import pytest
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from planar_chain_sim.command_line import Mistake
from planar_chain_sim.ros.parameters import declare_parameters, PARAMETERS


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
        nodes.append(Node('simulator', context=context, cli_args=arguments, start_parameter_services=False,
                          automatically_declare_parameters_from_overrides=True))
        return declare_parameters(nodes[-1]), nodes[-1]
    yield declare
    for node in nodes:
        node.destroy_node()


def test_defaults(declared):
    values, node = declared()
    assert values == {row.name: row.default for row in PARAMETERS}
    assert values['rate'] == 1000.0 and values['chain_file'] == 'four_link_robot.yaml'
    assert values['on_controller_loss'] == 'zero' and values['record'] == ''


def test_every_parameter_is_described_and_read_only(declared):
    _, node = declared('rate:=500.0')
    for row in PARAMETERS:
        descriptor = node.describe_parameter(row.name)
        assert descriptor.description == row.description and descriptor.read_only
        if row.limits:
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
    ('real_time_factor:=0', "parameter 'real_time_factor' is 0.0, must be from 0.001 to 1000"),
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
