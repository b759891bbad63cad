"""The node's services and everything else that need not keep time, in threads of their own, so that no tick waits."""
from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Thread
from time import monotonic

from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import SetBool, Trigger

from .standard_services import create_standard_services

LAST_TURNS = 8   # turns of the executor for answers that have begun
LAST_ANSWERS = 1.0   # s, for answers that wait for the tick thread when the node ends


class _Turn:
    """A coroutine awaits this to let others run in the same executor."""

    def __await__(self):
        yield


class ServiceThread:
    """
    Serves ~/reset, ~/step and ~/pause of a Simulator, and what the node itself offers, between start() and stop().

    Requests to the simulator wait in a second thread, in the order in which they came, while other services answer.
    `done(error)` is called when a thread cannot go on, `done(None)` when a client asks the process to end.
    """

    def __init__(self, node, simulator, done):
        self._node, self._done, self._stopping = node, done, False
        self._asking, self._waiting = ThreadPoolExecutor(1, 'asking'), 0   # coroutines that wait for it
        self._group = ReentrantCallbackGroup()   # many of these may wait at once
        for name, service_type, ask in (('reset', Trigger, lambda request: simulator.reset()),
                                        ('step', Trigger, lambda request: simulator.step()),
                                        ('pause', SetBool, lambda request: simulator.pause(request.data))):
            node.create_service(service_type, f'~/{name}', self._answering(ask), callback_group=self._group)
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)  # the ROS clock may be this node, or stand still
        self._executor = SingleThreadedExecutor()
        create_standard_services(node, simulator, self._group, lambda: done(None), self._ask)
        self._executor.add_node(node)
        self._thread = Thread(target=self._spin, name='services', daemon=True)

    def every(self, period: float, work) -> None:
        """Call `work()`, which must not make requests to the simulator, every `period` s of wall time."""
        self._node.create_timer(period, work, clock=self._clock)

    def ask_every(self, period: float, work) -> None:
        """Call `work()`, which may make requests to the simulator, every `period` s of wall time."""
        async def ask():
            await self._ask(work)
        self._node.create_timer(period, ask, MutuallyExclusiveCallbackGroup(), self._clock)

    def start(self) -> None:
        """Start answering; the services that set parameters are complete by now."""
        for service in self._node.services:
            if service.srv_type in (SetParameters, SetParametersAtomically):
                service.callback, service.callback_group = self._asked(service.callback), self._group
        self._thread.start()

    def stop(self) -> None:
        """Finish the answers that have begun, end the threads, and then shut down the executor, which has no lock."""
        self._stopping = True
        self._executor.create_task(lambda: None)  # something to do, so that the wait ends
        self._thread.join()
        self._asking.shutdown()
        self._executor.shutdown()

    def _spin(self) -> None:
        try:
            while not self._stopping:
                self._executor.spin_once()
            until = monotonic() + LAST_ANSWERS
            while self._waiting and monotonic() < until:
                self._executor.spin_once(timeout_sec=0.01)
            for _ in range(LAST_TURNS):
                self._executor.spin_once(timeout_sec=0.0)
        except BaseException as error:
            self._done(error)

    async def _ask(self, function, *arguments):
        """Call a function that may wait for the tick thread, and return its result."""
        self._waiting += 1
        try:
            asked = self._asking.submit(function, *arguments)
            asked.add_done_callback(lambda future: self._executor.wake())
            while not asked.done():
                await _Turn()
            return asked.result()
        finally:
            self._waiting -= 1

    def _asked(self, callback):
        """Return a service's callback as one that runs in the second thread, where it may wait."""
        async def wait(request, response):
            return await self._ask(callback, request, response)
        return wait

    def _answering(self, ask):
        """Return the callback of a service whose answer is (success, sentence)."""
        async def answer(request, response):
            response.success, response.message = await self._ask(ask, request)
            return response
        return answer
