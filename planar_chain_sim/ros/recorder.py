"""The log of a live run: a channel for every topic of the node, the chain, and what else a re-run takes."""
from __future__ import annotations

from .messages import INPUTS, OUTPUTS
from ..command_line import Mistake
from ..recording.log_writer import BackgroundLogWriter, LogError
from ..recording.rosbag2_profile import Channel
from ..recording.run_settings import settings_of


def open_log(simulation, values, publishers, inputs) -> BackgroundLogWriter:
    """Return the log of the parameter `record`, begun at the simulation's present tick; Mistake if it can't be."""
    rows = {**OUTPUTS, **INPUTS}
    channels = [Channel(part.topic_name, rows[key].type_name, rows[key].depth)
                for key, part in {**publishers, **inputs}.items()]
    settings = settings_of(simulation, publishers['state'].topic_name, publishers['events'].topic_name)
    try:
        return BackgroundLogWriter(
            values['record'], channels, {'chain.yaml': simulation.own_chain.source.encode()},
            {'planar_chain_sim': settings}, values['record_flush_period'], values['record_compression'])
    except LogError as error:
        raise Mistake(str(error)) from None
