"""The node's services and parameter services, answered in a thread of their own so that no tick waits for them."""
from __future__ import annotations

from threading import Thread

from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import SetBool, Trigger


class ServiceThread:
    """
    Serves ~/reset, ~/step and ~/pause of a Simulator, and all else the node itself offers, between start() and stop().

    `done(error)` is called when the thread cannot go on.
    """

    def __init__(self, node, simulator, done):
        self._done, self._stopping = done, False
        for name, ask in (('reset', lambda request: simulator.ask('reset')),
                          ('step', lambda request: simulator.ask('step')),
                          ('pause', lambda request: simulator.ask('pause', request.data))):
            node.create_service(SetBool if name == 'pause' else Trigger, f'~/{name}', _answering(ask))
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._thread = Thread(target=self._spin, name='services', daemon=True)

    def start(self) -> None:
        """Start answering."""
        self._thread.start()

    def stop(self) -> None:
        """Finish the answer in hand and end the thread; the executor goes last, it is not made for races."""
        self._stopping = True
        self._executor.create_task(lambda: None)  # something to do, so that the wait ends
        self._thread.join()
        self._executor.shutdown()

    def _spin(self) -> None:
        try:
            while not self._stopping:
                self._executor.spin_once()
        except BaseException as error:
            self._done(error)


def _answering(ask):
    def callback(request, response):
        response.success, response.message = ask(request)
        return response
    return callback
