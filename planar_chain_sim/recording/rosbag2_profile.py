"""The records of rosbag2 of ROS 2 Jazzy (bag information version 9) about topics: offered QoS, type hashes, totals."""
from __future__ import annotations

from dataclasses import dataclass
import os
from typing import Mapping, Sequence

import yaml

from .message_types import MESSAGE_TYPES

NO_TIME = 2 ** 63 - 1   # starting time of an empty bag, ns

_FOREVER = {'sec': 9223372036, 'nsec': 854775807}


@dataclass(frozen=True)
class Channel:
    """One topic of a log: fully qualified name, a type out of MESSAGE_TYPES, QoS of its publisher or subscription."""

    topic: str
    type_name: str
    depth: int = 10
    reliability: str = 'reliable'
    durability: str = 'volatile'
    history: str = 'keep_last'


def offered_qos_profiles(channel: Channel) -> list:
    """Return the channel's QoS as a rosbag2 sequence of one profile: all nine keys, policies in words."""
    return [{
        'history': channel.history, 'depth': channel.depth,
        'reliability': channel.reliability, 'durability': channel.durability,
        'deadline': dict(_FOREVER), 'lifespan': dict(_FOREVER),
        'liveliness': 'automatic', 'liveliness_lease_duration': dict(_FOREVER),
        'avoid_ros_namespace_conventions': False}]


def channel_metadata(channel: Channel) -> dict:
    """Return the metadata {str: str} of an MCAP channel record."""
    return {'offered_qos_profiles': yaml.safe_dump(offered_qos_profiles(channel), sort_keys=False),
            'topic_type_hash': MESSAGE_TYPES[channel.type_name].type_hash}


def bag_information(file_name: str, channels: Sequence[Channel], counts: Mapping[str, int], first: int,
                    last: int) -> str:
    """
    Return the YAML text of rosbag2's bag information for a bag of one file.

    counts: messages per topic; first, last: log times, ns, both NO_TIME for an empty bag.
    """
    topics = [{
        'topic_metadata': {
            'name': channel.topic, 'type': channel.type_name, 'serialization_format': 'cdr',
            'offered_qos_profiles': offered_qos_profiles(channel),
            'type_description_hash': MESSAGE_TYPES[channel.type_name].type_hash},
        'message_count': 0} for channel in channels]
    return _filled({
        'version': 9, 'storage_identifier': 'mcap', 'duration': {}, 'starting_time': {}, 'message_count': 0,
        'topics_with_message_count': topics, 'compression_format': '', 'compression_mode': '',
        'relative_file_paths': [], 'files': [], 'custom_data': {}, 'ros_distro': os.environ.get('ROS_DISTRO', '')},
        file_name, counts, first, last)


def filled_bag_information(text: str, file_name: str, counts: Mapping[str, int], first: int, last: int) -> str:
    """Return another bag's information with what bag_information() takes; ValueError: the text is none."""
    try:
        return _filled(yaml.safe_load(text), file_name, counts, first, last)
    except (yaml.YAMLError, LookupError, TypeError, ValueError, AttributeError, RecursionError):
        raise ValueError("the bag information 'rosbag2' is damaged") from None


def _filled(information: dict, file_name: str, counts: Mapping[str, int], first: int, last: int) -> str:
    start = {'nanoseconds_since_epoch': int(first)}
    duration = {'nanoseconds': int(last) - int(first)}
    total = sum(counts.values())
    for topic in information['topics_with_message_count']:
        topic['message_count'] = counts.get(topic['topic_metadata']['name'], 0)
    information.update(
        duration=duration, starting_time=start, message_count=total, relative_file_paths=[file_name],
        files=[{'path': file_name, 'starting_time': dict(start), 'duration': dict(duration), 'message_count': total}])
    return yaml.safe_dump(information, sort_keys=False)
