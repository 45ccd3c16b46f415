# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What can be done to a world between two steps, as a value: to record it, and to do it again."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from rigid_sim_ros.world.readings import Readings

# Names of the methods of World that change it.
KINDS = frozenset({'add', 'apply_impulse', 'apply_wrench', 'cancel_wrenches',
                   'follow_trajectory', 'remove', 'reset', 'set_joint_command',
                   'set_joint_commands', 'set_joint_state', 'set_joint_states', 'set_pose',
                   'set_twist'})
# What may be said of a command besides the arguments of its method: how the message that brought a
# wrench named its frame, for the world's may have another name outside.
FRAME_ID = 'frame_id'


class Command(NamedTuple):
    """A call of one of the methods KINDS."""

    kind: str
    arguments: Mapping[str, Any]  # by name

    @property
    def given(self) -> dict[str, Any]:
        """The arguments of the method."""
        return {name: value for name, value in self.arguments.items() if name != FRAME_ID}


# Takes World.step_index as it was before a command, and the command.
Observer = Callable[[int, Command], None]

# Attributes of a world that are not its state: who observes it, and what is being done to it.
OWN = ('_observers', '_command')


class Commanded(Readings):
    """The part of World that does commands, and tells who observes them."""

    step_index: int
    _observers: list[Observer]
    _command: Command | None    # that is being applied

    def _begin_commands(self) -> None:
        self._observers = []
        self._command = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy has: nobody observes it."""
        return {**self.__dict__, '_observers': []}

    def apply(self, command: Command) -> None:
        """
        Do what a command says; ValueError, and nothing is done, where the method would refuse it.

        TypeError for arguments that the method does not have.
        """
        if command.kind not in KINDS:
            raise ValueError(f'{command.kind!r} is no command, must be one of: '
                             f'{", ".join(sorted(KINDS))}')
        self._command = command
        try:
            getattr(self, command.kind)(**command.given)
        finally:
            self._command = None

    def observe(self, observer: Observer) -> None:
        """Call an observer after each command that was done, also by a call of its method."""
        self._observers.append(observer)

    def forget(self, observer: Observer) -> None:
        """Call an observer no more."""
        self._observers.remove(observer)

    def _tell(self, kind: str, step: int | None = None, **arguments: Any) -> None:
        """Tell the observers of a command that was done, at this step unless another is given."""
        for observer in self._observers:
            observer(self.step_index if step is None else step,
                     self._command or Command(kind, arguments))
