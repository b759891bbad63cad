"""Executables without ROS: stop signals are caught before anything heavy is imported, which may take a second."""
from __future__ import annotations

from functools import partial
from importlib import import_module
import os
import signal

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
MODULES = {'rollout': 'recording.rollout', 'resimulate': 'resimulation.command_line',
           'benchmark': 'benchmark.command_line', 'equations': 'symbolic.command_line', 'urdf': 'urdf_file',
           'animate': 'pictures.animation', 'plot': 'pictures.plot', 'view': 'view.command_line',
           'info': 'recording.info', 'repair': 'recording.repair'}


def run(program: str) -> int:
    """Run an executable of this name; return its exit code."""
    def leave(number, frame) -> None:   # there is nothing to be finished yet
        os.write(2, f'{program}: interrupted\n'.encode())
        os._exit(128 + number)
    for number in STOP_SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:   # as under nohup
            signal.signal(number, leave)
    return import_module(f'{__package__}.{MODULES[program]}').main()


rollout, resimulate, benchmark, equations, urdf, animate, plot, view, info, repair = (
    partial(run, program) for program in MODULES)
