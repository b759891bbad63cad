"""The log of a live run: a channel for every topic of the node, the chain, and all else that a re-run needs."""
from __future__ import annotations

from .messages import INPUTS, OUTPUTS
from ..errors import LogError, Mistake
from ..recording.log_writer import BackgroundLogWriter
from ..recording.rosbag2_profile import Channel
from ..recording.run_settings import settings_of


def open_log(simulation, values, publishers, inputs) -> BackgroundLogWriter:
    """Return the log of the parameter `record`, begun at the simulation's present tick; Mistake if it can't be."""
    rows = {**OUTPUTS, **INPUTS}
    channels = [channel_of(part, rows[key].type_name) for key, part in {**publishers, **inputs}.items()]
    settings = settings_of(simulation, publishers['state'].topic_name, publishers['events'].topic_name)
    try:
        return BackgroundLogWriter(
            values['record'], channels, {'chain.yaml': simulation.own_chain.source.encode()},
            {'planar_chain_sim': settings}, values['record_flush_period'], values['record_compression'])
    except LogError as error:
        raise Mistake(str(error)) from None


def channel_of(end, type_name: str) -> Channel:
    """Return the channel of a publisher or subscription, with the QoS that it has, overrides included."""
    qos = end.qos_profile
    return Channel(end.topic_name, type_name, qos.depth, qos.reliability.short_key, qos.durability.short_key,
                   qos.history.short_key)
