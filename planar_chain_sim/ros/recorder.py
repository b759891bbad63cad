"""The log of a live run: a channel for every topic of the node, the chain, and all else that a re-run needs."""
from __future__ import annotations

from time import time_ns

from .messages import INPUTS, OUTPUTS, SIDE_OUTPUTS
from ..errors import LogError, Mistake
from ..recording.log_writer import BackgroundLogWriter
from ..recording.recorded_frames import FrameChannels, RecordedFrames
from ..recording.rosbag2_profile import Channel
from ..recording.run_settings import settings_of


def open_log(simulation, values, publishers, inputs, frames=None) -> BackgroundLogWriter:
    """
    Return the log of the parameter `record`, begun at the simulation's present tick; Mistake if it can't be.

    `frames`: RecordedFrames or None.
    """
    rows = {**OUTPUTS, **INPUTS}
    channels = [channel_of(part, rows[key].type_name) for key, part in {**publishers, **inputs}.items()]
    channels += frames.channels if frames else ()
    settings = settings_of(simulation, publishers['state'].topic_name, publishers['events'].topic_name)
    try:
        log = BackgroundLogWriter(
            values['record'], channels, {'chain.yaml': simulation.own_chain.source.encode()},
            {'planar_chain_sim': settings}, values['record_flush_period'], values['record_compression'])
    except LogError as error:
        raise Mistake(str(error)) from None
    if frames:
        frames.write_start(log.write, time_ns())
    return log


def recorded_frames(node, simulation, urdf: str, frames) -> RecordedFrames:
    """Return what `record_tf` adds to the log: `urdf` and its LinkFrames, on the topics that the node has for them."""
    channels = FrameChannels(*(
        Channel(node.resolve_topic_name(topic.name), topic.type_name, topic.depth,
                durability='transient_local' if topic.latched else 'volatile')
        for topic in (SIDE_OUTPUTS[key] for key in ('description', 'tf_static', 'tf'))))
    return RecordedFrames(urdf, frames, simulation.chain.joint_names, simulation.step, channels)


def channel_of(end, type_name: str) -> Channel:
    """Return the channel of a publisher or subscription, with the QoS that it has, overrides included."""
    qos = end.qos_profile
    return Channel(end.topic_name, type_name, qos.depth, qos.reliability.short_key, qos.durability.short_key,
                   qos.history.short_key)
