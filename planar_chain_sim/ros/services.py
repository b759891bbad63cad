"""The node's services and whatever else may take its time, in a thread of its own so that no tick waits for it."""
from __future__ import annotations

from threading import Thread

from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import SetBool, Trigger

from .standard_services import offer

LAST_TURNS = 8   # of the executor, for answers in hand that had let others have a turn


class ServiceThread:
    """
    Serves ~/reset, ~/step and ~/pause of a Simulator, and all else the node itself offers, between start() and stop().

    `done(error)` is called when the thread cannot go on, `done(None)` when somebody wants the process to end.
    """

    def __init__(self, node, simulator, done):
        self._node, self._done, self._stopping = node, done, False
        for name, ask in (('reset', lambda request: simulator.ask('reset')),
                          ('step', lambda request: simulator.ask('step')),
                          ('pause', lambda request: simulator.ask('pause', request.data))):
            node.create_service(SetBool if name == 'pause' else Trigger, f'~/{name}', _answering(ask))
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)  # the ROS clock may be ours to move, or stand still
        self._executor = SingleThreadedExecutor()
        offer(node, simulator, self._executor, lambda: done(None))
        self._executor.add_node(node)
        self._thread = Thread(target=self._spin, name='services', daemon=True)

    def every(self, period: float, work) -> None:
        """Have `work()` done every `period` s of wall time."""
        self._node.create_timer(period, work, clock=self._clock)

    def start(self) -> None:
        """Start answering."""
        self._thread.start()

    def stop(self) -> None:
        """Finish the answers in hand and end the thread; the executor goes last, it is not made for races."""
        self._stopping = True
        self._executor.create_task(lambda: None)  # something to do, so that the wait ends
        self._thread.join()
        self._executor.shutdown()

    def _spin(self) -> None:
        try:
            while not self._stopping:
                self._executor.spin_once()
            for _ in range(LAST_TURNS):
                self._executor.spin_once(timeout_sec=0.0)
        except BaseException as error:
            self._done(error)


def _answering(ask):
    def callback(request, response):
        response.success, response.message = ask(request)
        return response
    return callback
