"""
The services and the action of `simulation_interfaces`, where that package is installed: what every simulator offers.

Numbers and fields are those of its message definitions (version 1, the same on Jazzy and later). Time is never reset:
it would jump back, and listeners would stop.
"""
from __future__ import annotations

from typing import Awaitable, Callable

# SimulatorFeatures: reset, of the state; state got, set, pause; steps single, multiple, by action.
FEATURES = (20, 22, 24, 25, 26, 31, 32, 33)
FEATURE_UNSUPPORTED, OK, OPERATION_FAILED, ALREADY_IN_TARGET_STATE = 0, 1, 4, 101   # Result
SCOPE_DEFAULT, SCOPE_STATE, SCOPE_ALL = 0, 2, 255   # ResetSimulation
STOPPED, PLAYING, PAUSED, QUITTING = 0, 1, 2, 3     # SimulationState


class StandardServices:
    """Answers for a Simulator; `quit()` ends the process, `await ask(function, ...)` lets others have a turn."""

    def __init__(self, simulator, quit_process: Callable[[], None], name: str, ask: Callable[..., Awaitable]):
        self._simulator, self._quit, self._name, self._ask = simulator, quit_process, name, ask
        self._stopped_at = None  # tick at which a client stopped it
        self.rows = {   # name of the service -> (type, answer)
            'get_simulator_features': ('GetSimulatorFeatures', self.features),
            'reset_simulation': ('ResetSimulation', self.reset),
            'step_simulation': ('StepSimulation', self.step),
            'get_simulation_state': ('GetSimulationState', self.get_state),
            'set_simulation_state': ('SetSimulationState', self.set_state)}

    def features(self, request, response):
        """Say what is supported."""
        response.features.features = list(FEATURES)
        response.features.custom_info = f'planar_chain_sim, node {self._name}; time is never reset'
        return response

    async def reset(self, request, response):
        """Restore the initial state; the scopes of time or of spawned entities alone are not supported."""
        if request.scope in (SCOPE_DEFAULT, SCOPE_STATE, SCOPE_ALL):
            return _answer(response, *await self._ask(self._simulator.reset))
        return _fail(response, FEATURE_UNSUPPORTED, f'scope {request.scope} is not supported, must be STATE '
                     f'({SCOPE_STATE}) or ALL ({SCOPE_ALL})')

    async def step(self, request, response):
        """Step this many ticks, while paused; a pause, resume or reset meanwhile ends it."""
        total, completed, overruled = request.steps, 0, self._simulator.overruled
        while completed < total:
            done, result = await self._ask(self._simulator.step_on, total - completed, overruled)
            if not done:
                return _fail(response, OPERATION_FAILED, f'{result} ({completed} of {total} steps done)')
            completed += result
        return _answer(response, True, '')

    def get_state(self, request, response):
        """Say whether it is playing, paused or stopped."""
        response.state.state = self._state()
        return _answer(response, True, '')

    async def set_state(self, request, response):
        """Play, pause, stop (pause and reset) or quit."""
        wanted = request.state.state
        if wanted == self._state():
            return _fail(response, ALREADY_IN_TARGET_STATE, 'already so')
        if wanted == QUITTING:
            self._quit()
        elif wanted in (PLAYING, PAUSED, STOPPED):
            self._stopped_at = None
            done, sentence = await self._ask(self._simulator.pause, wanted != PLAYING, wanted == STOPPED)
            if done and wanted == STOPPED:
                self._stopped_at = self._simulator.tick
            return _answer(response, done, sentence)
        else:
            return _fail(response, OPERATION_FAILED, f'state {wanted} is none, must be 0 to 3')
        return _answer(response, True, '')

    async def simulate(self, goal, action_type):
        """Step this many ticks, with feedback, until done or cancelled."""
        result, feedback = action_type.Result(), action_type.Feedback()
        total, completed, overruled = goal.request.steps, 0, self._simulator.overruled
        while completed < total:
            done, made = await self._ask(self._simulator.step_on, total - completed, overruled)
            if not done:
                goal.abort()
                return _fail(result, OPERATION_FAILED, made)
            completed += made
            feedback.completed_steps, feedback.remaining_steps = completed, total - completed
            goal.publish_feedback(feedback)
            if goal.is_cancel_requested:
                goal.canceled()
                return _fail(result, OPERATION_FAILED, f'cancelled after {completed} of {total} steps')
        goal.succeed()
        return _answer(result, True, '')

    def _state(self) -> int:
        if not self._simulator.paused:
            return PLAYING
        return STOPPED if self._stopped_at == self._simulator.tick else PAUSED


def _answer(response, done: bool, sentence: str):
    return _fail(response, OK if done else OPERATION_FAILED, '' if done else sentence)


def _fail(response, code: int, sentence: str):
    response.result.result, response.result.error_message = code, sentence
    return response


def create_standard_services(node, simulator, group, quit_process: Callable[[], None], ask) -> None:
    """Create all of it on the node, in a callback group, where the package is installed; `ask`: of StandardServices."""
    try:
        from simulation_interfaces import srv
        from simulation_interfaces.action import SimulateSteps
    except ImportError:
        return
    from rclpy.action import ActionServer, CancelResponse
    services = StandardServices(simulator, quit_process, node.get_fully_qualified_name(), ask)
    for name, (type_name, answer) in services.rows.items():
        node.create_service(getattr(srv, type_name), f'~/{name}', answer, callback_group=group)

    async def execute(goal):
        return await services.simulate(goal, SimulateSteps)
    ActionServer(node, SimulateSteps, '~/simulate_steps', execute, callback_group=group,
                 cancel_callback=lambda goal: CancelResponse.ACCEPT)
