"""The settings of a run, except its chain and changes, as text in a log that loses no bit, and read back from it."""
from __future__ import annotations

from dataclasses import replace
import json
from platform import machine

import numpy as np

from .log_reader import LogFile
from .. import __version__, _kernel
from ..chain_file import chain_from_text
from ..errors import ChainError, LogError
from ..motion.simulation import Simulation

FORMAT = '1'


def settings_of(simulation: Simulation, state_topic: str, events_topic: str) -> dict[str, str]:
    """Return the metadata 'planar_chain_sim' of a log that begins at the simulation's present tick and state."""
    return {
        'format': FORMAT, 'version': __version__, 'build': f'{_kernel.compiler} {machine()}',
        'method': simulation.method, 'step': simulation.step.hex(), 'form': simulation.form_asked,
        'tolerance': '' if simulation.tolerance is None else float(simulation.tolerance).hex(),
        'joint_names': json.dumps(simulation.chain.joint_names),
        'state_topic': state_topic, 'events_topic': events_topic, 'tick': str(simulation.tick),
        'position': json.dumps([value.hex() for value in simulation.position.tolist()]),
        'velocity': json.dumps([value.hex() for value in simulation.velocity.tolist()])}


def simulation_of(log: LogFile) -> Simulation:
    """Return the simulation that a log begins with, at its start; LogError: its chain or settings are bad."""
    settings = log.settings
    try:
        for key in ('state_topic', 'events_topic'):   # which the reader of the messages needs
            if not settings[key]:
                raise ValueError(f'its {key} is empty')
        if settings['format'] != FORMAT:
            raise ValueError(f'format is {settings["format"]!r}, must be {FORMAT!r}')
        chain = chain_from_text(log.chain_text, f'{log.path}: chain.yaml')
        tolerance = float.fromhex(settings['tolerance']) if settings['tolerance'] else None
        simulation = Simulation(chain, settings['method'], float.fromhex(settings['step']), tolerance, settings['form'])
        if tuple(json.loads(settings['joint_names'])) != chain.joint_names:
            raise ValueError('joint_names are not those of its chain.yaml')
        simulation.set_state(*(np.array([float.fromhex(value) for value in json.loads(settings[key])])
                               for key in ('position', 'velocity')))
        simulation.restore(replace(simulation.checkpoint(), tick=int(settings['tick'])))
    except KeyError as error:
        raise LogError(f'log {str(log.path)!r}: its settings lack {error}') from None
    except (ChainError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise LogError(f'log {str(log.path)!r}: {error}') from None
    return simulation


def readable_settings(settings: dict) -> dict:
    """Return the settings of a log, which makes a simulation, with their numbers as numbers."""
    readable = {**settings, 'step': float.fromhex(settings['step']), 'tick': int(settings['tick']),
                'tolerance': float.fromhex(settings['tolerance']) if settings['tolerance'] else None,
                'joint_names': json.loads(settings['joint_names'])}
    for key in ('position', 'velocity'):
        readable[key] = [float.fromhex(value) for value in json.loads(settings[key])]
    return readable
