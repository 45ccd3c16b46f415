# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The services of the node `simulate`: each waits until the step thread has done what it asks."""
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from rigid_sim_ros.nodes.inputs import Command, ENDED, Queue


class Services:
    """~/pause, ~/step and ~/reset."""

    def __init__(self, node: Node, queue: Queue) -> None:
        self._queue = queue
        node.create_service(SetBool, '~/pause', self._pause)
        node.create_service(Trigger, '~/step', self._trigger('step'))
        node.create_service(Trigger, '~/reset', self._trigger('reset'))

    def _pause(self, request: Any, response: Any) -> Any:
        return self._do('pause' if request.data else 'resume', response)

    def _trigger(self, command: str) -> Callable[[Any, Any], Any]:
        return lambda request, response: self._do(command, response)

    def _do(self, command: str, response: Any) -> Any:
        # The step thread looks at its queue between batches of steps and answers what is left in
        # it when it ends: the executor waits for one batch, and never for ever.
        answer: Future[tuple[bool, str]] = Future()
        if self._queue.put(Command(command, answer)):
            response.success, response.message = answer.result()
        else:
            response.success, response.message = ENDED
        return response
