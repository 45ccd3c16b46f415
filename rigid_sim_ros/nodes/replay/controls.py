# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What other nodes ask of a replay: ~/pause, ~/step, ~/seek, and parameters that change live."""

from collections.abc import Sequence
import math
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from rigid_sim_ros.nodes.replay.parameters import LIVE
from rigid_sim_ros.nodes.replay.player import Answer, Player

# The rates that the keyboard goes through.
_RATES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


class Controls:
    """Hands over to the player what arrives."""

    def __init__(self, node: Node, player: Player) -> None:
        self._node = node
        self._player = player
        node.create_service(SetBool, '~/pause', self._pause)
        node.create_service(Trigger, '~/step', self._step)
        node.create_subscription(Float64, '~/seek', self._seek, 10)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._take_over)

    def change_rate(self, direction: int) -> None:
        """Set the parameter `rate` to the next lower or higher of some round figures."""
        now = self._player.status().rate
        others = ([rate for rate in _RATES if rate > now * 1.001] if direction > 0
                  else [rate for rate in reversed(_RATES) if rate < now * 0.999])
        if others:
            self._node.set_parameters([Parameter('rate', value=others[0])])

    def _pause(self, request: Any, response: Any) -> Any:
        return _filled(response, self._player.ask('pause', request.data))

    def _step(self, request: Any, response: Any) -> Any:
        return _filled(response, self._player.ask('step'))

    def _seek(self, message: Any) -> None:
        if math.isfinite(message.data):
            self._player.tell('seek', message.data)
        else:
            self._node.get_logger().warning(
                f'refused ~/seek: {message.data}, must be seconds from the beginning of the bag')

    def _check(self, parameters: Sequence[Any]) -> Any:
        # The ranges are checked by rclpy, which has let NaN pass in other versions.
        for parameter in parameters:
            if parameter.value != parameter.value:
                return SetParametersResult(
                    successful=False, reason=f'{parameter.name}: must be a number')
        return SetParametersResult(successful=True)

    def _take_over(self, parameters: Sequence[Any]) -> None:
        for parameter in parameters:
            if parameter.name in LIVE:
                self._player.tell(parameter.name, parameter.value)


def _filled(response: Any, answer: Answer) -> Any:
    response.success, response.message = answer
    return response
