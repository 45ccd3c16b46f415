# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The services of the node `simulate`: each waits until the step thread has done what it asks."""
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger

from rigid_sim_ros.bag.errors import BagError
from rigid_sim_ros.nodes.inputs import ENDED, Queue, Request
from rigid_sim_ros.nodes.recording import Recording

# Of requests that wait and of answers on their way. By ROS's default it is 10: what a client asks
# beyond that before it is answered would be lost. Not all are kept: then a client that stands
# still and takes no answers would hold up those of all others.
_QOS = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)


class Services:
    """~/pause, ~/step, ~/reset, ~/start_recording and ~/stop_recording."""

    def __init__(self, node: Node, queue: Queue, recording: Recording) -> None:
        self._queue = queue
        self._recording = recording
        self._log = node.get_logger()
        for service, name, callback in (
            (SetBool, 'pause', self._pause),
            (Trigger, 'step', self._trigger('step')),
            (Trigger, 'reset', self._trigger('reset')),
            (Trigger, 'start_recording', self._start_recording),
            (Trigger, 'stop_recording', self._stop_recording),
        ):
            node.create_service(service, f'~/{name}', callback, qos_profile=_QOS)

    def _pause(self, request: Any, response: Any) -> Any:
        return self._do('pause' if request.data else 'resume', response)

    def _trigger(self, command: str) -> Callable[[Any, Any], Any]:
        return lambda request, response: self._do(command, response)

    def _start_recording(self, request: Any, response: Any) -> Any:
        try:
            self._recording.create()
        except BagError as error:
            self._log.error(f'not recording: {error}')
            response.success, response.message = False, str(error)
            return response
        self._do('start_recording', response)
        if not response.success:
            self._recording.close()     # the simulation has ended meanwhile
        return response

    def _stop_recording(self, request: Any, response: Any) -> Any:
        self._do('stop_recording', response)
        if response.success:
            response.success, response.message = self._recording.finish()
        return response

    def _do(self, command: str, response: Any) -> Any:
        # The step thread looks at its queue between batches of steps and answers what is left in
        # it when it ends: the executor waits for one batch, and never for ever.
        answer: Future[tuple[bool, str]] = Future()
        if self._queue.put(Request(command, answer)):
            response.success, response.message = answer.result()
        else:
            response.success, response.message = ENDED
        return response
