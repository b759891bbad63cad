"""
A client by another vendor: CycloneDDS, with no ROS in the process, commands the arm and receives its states.

    python cyclone_client.py DOMAIN SOURCE_TIME EFFORT...

It publishes the efforts, sent at SOURCE_TIME, ns, as it says, until a state shows that they act, then says so.
"""
from dataclasses import dataclass
import os
import sys
import time

PATIENCE = 240.0  # s
# Loopback alone and by unicast, as the node's participants are looked for too.
os.environ['CYCLONEDDS_URI'] = """<CycloneDDS><Domain Id="any">
  <General><AllowMulticast>false</AllowMulticast><Interfaces><NetworkInterface name="lo"/></Interfaces></General>
  <Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <Peers><Peer Address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""

from cyclonedds.core import Policy, Qos  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.idl import IdlStruct  # noqa: E402
from cyclonedds.idl.types import float64, int32, sequence, uint32  # noqa: E402
from cyclonedds.pub import DataWriter  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402
from cyclonedds.util import duration  # noqa: E402


@dataclass
class Time(IdlStruct, typename='builtin_interfaces::msg::dds_::Time_'):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename='std_msgs::msg::dds_::Header_'):
    stamp: Time
    frame_id: str


@dataclass
class JointState(IdlStruct, typename='sensor_msgs::msg::dds_::JointState_'):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class Dimension(IdlStruct, typename='std_msgs::msg::dds_::MultiArrayDimension_'):
    label: str
    size: uint32
    stride: uint32


@dataclass
class Layout(IdlStruct, typename='std_msgs::msg::dds_::MultiArrayLayout_'):
    dim: sequence[Dimension]
    data_offset: uint32


@dataclass
class Float64MultiArray(IdlStruct, typename='std_msgs::msg::dds_::Float64MultiArray_'):
    layout: Layout
    data: sequence[float64]


def main():
    efforts = [float(value) for value in sys.argv[3:]]
    participant = DomainParticipant(int(sys.argv[1]))
    qos = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepLast(10))
    states = DataReader(participant, Topic(participant, 'rt/joint_states', JointState, qos=qos), qos=qos)
    commands = DataWriter(participant, Topic(participant, 'rt/simulator/commands', Float64MultiArray, qos=qos), qos=qos)
    received, end = 0, time.monotonic() + PATIENCE
    while time.monotonic() < end:
        commands.write(Float64MultiArray(Layout([], 0), efforts), timestamp=int(sys.argv[2]))
        for state in states.take(N=100):
            received += 1
            if state.effort == efforts:
                print(f'acts after {received} states of {",".join(state.name)}', flush=True)
                return 0
        time.sleep(0.01)
    print(f'no answer, {received} states', flush=True)
    return 1


if __name__ == '__main__':
    sys.exit(main())
