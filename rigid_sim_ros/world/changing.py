# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The part of `World` in which bodies, joints and models come and go between two steps."""

from collections.abc import Callable, Mapping
import logging
import math
from typing import Any

import numpy as np

from rigid_sim_ros.engine.model.shapes import Shapes
from rigid_sim_ros.engine.solver.sleeping import linked_bodies
from rigid_sim_ros.engine.state.body_order import order_by_place
from rigid_sim_ros.engine.state.state import (
    BodyMotion, copy_state, MOVING_FIELDS, State, write_motion)
from rigid_sim_ros.kernels.arrays import IntArray
from rigid_sim_ros.scene import Scene, scene_from_dict, schema
from rigid_sim_ros.scene.additions import read_part, written
from rigid_sim_ros.scene.joints import combined, frame_in_child, Pose
from rigid_sim_ros.world.applied_wrenches import AppliedWrenches
from rigid_sim_ros.world.changes import (
    changed, checked, moved, Numbering, order_after, places_between, wake)
from rigid_sim_ros.world.commands import OWN
from rigid_sim_ros.world.joining import Before, Joining, ROUNDED
from rigid_sim_ros.world.joint_numbering import articulations, joint_numbering
from rigid_sim_ros.world.model_dynamics import WithModels

_logger = logging.getLogger(__name__)


class Changing(WithModels):
    """
    The part of `World` in which bodies, joints and models come and go.

    The scene of a changed world is that of its origin after the changes, read anew; what stays
    takes its dynamic state along, as a snapshot has it.
    """

    _origin: Scene
    _changes: list[list[Any]]   # what came and went since, see `add`
    _applied: AppliedWrenches
    _start: State
    _shapes: Shapes
    _index: dict[str, int]
    _threads: int

    # Of `World`.
    _set_up: Callable[[Scene, IntArray], None]
    _dynamic: Callable[[], dict[str, np.ndarray]]
    _take: Callable[[Mapping[str, np.ndarray], list[str]], None]

    def __init__(self, scene: Scene) -> None:
        """Let the world of a scene have no changes yet."""
        self._origin = scene
        self._changes = []

    @property
    def origin(self) -> Scene:
        """The scene that the world began with; `scene` has what it has now."""
        return self._origin

    @property
    def lasting_bodies(self) -> list[str]:
        """The names of the bodies that the world began with and has never been without."""
        gone = [name for what, name in self._changes if what == 'remove']
        return [name for name in self._origin.names
                if not any(name == other or name.startswith(f'{other}/') for other in gone)]

    def add(self, part: Mapping[str, Any]) -> None:
        """
        Let a part come before the next step, given as one of `bodies`, `joints` or `models`.

        Several at once are given under these keys, with pairs in `collision: {ignore: ...}` that
        are not to touch. Bodies begin with the pose and the twist that are given, models as their
        files say. Position 0 of a joint between bodies that are there already is where they are
        now, unless a `child_pose` says which frames meet; their momenta stay but for what the
        joint takes away. All others go on as if nothing had happened. SceneError, a ValueError,
        if the part is wrong or its name is taken, ValueError if a joint cannot close; then the
        world stays as it is. Files are looked for in the working directory.
        """
        parts, notes = read_part(part)
        brings = frozenset(joint.name for joint in parts.joints or () if joint.brings_child)
        parts = self._with_frames_of_now(parts)
        own, before = dict(self.__dict__), self._before()
        try:
            fresh = self._change([*self._changes, ['add', written(parts)]])
            self._settle(before, fresh, brings)
        except ValueError:
            self.__dict__.clear()
            self.__dict__.update(own)
            raise
        for note in notes:
            _logger.info('%s', note)
        # As it can be read anywhere: with its meshes in it.
        bodies = self.scene.spec.bodies
        complete = written(parts.model_copy(update={
            'bodies': bodies[len(bodies) - len(parts.bodies):]}))
        self._changes[-1] = ['add', complete]
        self._command = None
        self._tell('add', part=complete)

    def remove(self, name: str) -> None:
        """
        Let a body, a joint or a whole model go before the next step.

        With a body go joints that hold it, wrenches that act on it or in its frames, forces of the
        scene that name it, and its contacts; what lay on it wakes. With a joint go the couplings
        of joints that mimic it, and what drives were told of it. With a model go all its bodies
        and joints. A name that a body and a joint have is that of the body. ValueError for an
        unknown name, and for the last body.
        """
        before = self._before()
        self._settle(before, self._change([*self._changes, ['remove', name]]))
        self._tell('remove', name=name)

    def _follow_changes(self, changes: Any) -> None:
        """
        Hold what a snapshot says of changes; ValueError for what cannot be.

        The state is then one of which nothing is said: that of the snapshot takes its place.
        """
        self._change(checked(changes), may_read_files=False)

    def _change(self, changes: list[list[Any]], *, may_read_files: bool = True,
                ) -> dict[str, np.ndarray]:
        """
        Hold what there is after some changes of the origin.

        Returns the arrays of a snapshot that the world would have if it began now.
        """
        spec = self._origin.spec.model_dump(exclude_none=True)
        scene = scene_from_dict(changed(spec, changes), self._origin.name,
                                may_read_files=may_read_files)
        arrays = {name: array.copy() for name, array in self._dynamic().items()}
        sources, step, before = self._applied.sources, self.step_index, self._numbering()
        table = None if self._joints is None else self._joints.table
        wake(arrays, self._touched_by(scene), linked_bodies(self._model, table))
        self._set_up(scene, self._order_in(scene))
        fresh = {name: array.copy() for name, array in self._dynamic().items()}
        found, left = moved(arrays, fresh, places_between(before, self._numbering()))
        self._take({name: found.get(name, array) for name, array in fresh.items()},
                   [source for source, stays in zip(sources, left, strict=True) if stays])
        self._changes, self.step_index = changes, step
        return fresh

    def _touched_by(self, scene: Scene) -> set[int]:
        """Return the bodies that are gone in another scene, or have other joints there."""
        now, then = ({joint.name: joint for joint in one.spec.joints or ()}
                     for one in (self.scene, scene))
        names = set(self.names) - set(scene.names)
        for name in now.keys() ^ then.keys():
            joint = now.get(name) or then[name]
            names |= {joint.parent, joint.child}
        return {self._index[name] for name in names if name in self._index}

    def _order_in(self, scene: Scene) -> IntArray:
        """Return the order of the bodies in a changed scene; it depends on nothing else."""
        if scene.joints is not None:
            return first_order(scene)
        origin = self._origin
        return order_after(scene.names, [origin.names[i] for i in first_order(origin)])

    def _become(self, other: 'Changing') -> None:
        """Be another world from now on; who observes this one goes on observing it."""
        threads = self._threads
        self.__dict__.update({name: value for name, value in other.__dict__.items()
                              if name not in OWN})
        self.threads = threads

    def _numbering(self) -> Numbering:
        bodies = [self.names[i] for i in self._order]
        table = None if self._joints is None else self._joints.table
        return Numbering(bodies, self._shapes.body, self.frame_names, self._model.fixed,
                         joint_numbering(table, self.joint_names, bodies))

    # --- joints that come and go ----------------------------------------------------------------

    def _before(self) -> Before:
        """Return what there is now, for `Joining`."""
        still = np.ones(len(self.names), bool)
        for name in MOVING_FIELDS:
            still &= (getattr(self._state, name) == getattr(self._start, name)).all(axis=0)
        bodies = [self.names[i] for i in self._order]
        table = None if self._joints is None else self._joints.table
        held = () if table is None else articulations(table, self.joint_names, bodies)
        return Before(frozenset(bodies),
                      frozenset(name for name, stays in zip(bodies, still, strict=True) if stays),
                      frozenset(self.joint_names),
                      frozenset((one.joints, one.bodies) for one in held))

    def _settle(self, before: Before, fresh: Mapping[str, np.ndarray],
                brings: frozenset[str] = frozenset()) -> None:
        """Let the joints that are there now hold what they hold, see `Joining.settle`."""
        if self._joints is None:
            return
        Joining(self._joints, self._state, self.scene.spec, self.scene.names, before).settle(
            fresh, brings)
        self._motion_is_current = False

    def _with_frames_of_now(self, parts: schema.Scene) -> schema.Scene:
        """
        Return parts whose joints say where their frames are in bodies that have moved.

        What these hold is brought together at the start, wherever the bodies are written.
        """
        given = {body.name: (body.pose.position, body.pose.orientation) for body in parts.bodies}
        joints = []
        for joint in parts.joints or ():
            ends = (joint.parent, joint.child)
            if any(name in self._index and not self._is_as_written(name) for name in ends) and (
                    all(name == 'world' or name in self._index or name in given
                        for name in ends)):
                joint = self._of_now(joint, *(
                    given.get(name) or self._pose_of(name) for name in ends))
            joints.append(joint)
        return parts if parts.joints is None else parts.model_copy(
            update={'joints': tuple(joints)})

    @staticmethod
    def _of_now(joint: schema.Joint, parent: Pose, child: Pose) -> schema.Joint:
        frame = joint.pose.position, joint.pose.orientation
        update: dict[str, Any] = {'brings_child': True}
        if joint.child_pose is None:
            position, orientation = frame_in_child(parent, child, frame)
            update['child_pose'] = schema.Pose.model_construct(
                position=position, orientation=orientation)
        elif joint.type == 'distance' and joint.length is None:
            other = joint.child_pose.position, joint.child_pose.orientation
            update['length'] = math.dist(combined(parent, frame)[0], combined(child, other)[0])
        return joint.model_copy(update=update)

    def _is_as_written(self, name: str) -> bool:
        """Return whether a body is where the scene has it written, but for rounding."""
        i = self._index[name]
        pose = self.scene.spec.bodies[int(self._order[i])].pose
        written_at = copy_state(self._state)
        motion = BodyMotion(*(array.copy() for array in self._current_motion()))
        motion.position[i], motion.orientation[i] = pose.position, pose.orientation
        write_motion(self._model, written_at, motion, i)
        x, q = written_at.x[:, i], written_at.q[:, i]
        return bool((np.abs(x - self._state.x[:, i]) <= ROUNDED * (1.0 + np.abs(x))).all()
                    and (np.abs(q - self._state.q[:, i]) <= ROUNDED).all())

    def _pose_of(self, name: str) -> Pose:
        if name == 'world':
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
        motion, i = self._current_motion(), self._index[name]
        x, y, z = motion.position[i].tolist()
        a, b, c, d = motion.orientation[i].tolist()
        return (x, y, z), (a, b, c, d)


def first_order(scene: Scene) -> IntArray:
    """Return the order in which the engine has the bodies of a scene that begins."""
    # The tables of joints have the bodies in the order of the scene.
    if scene.joints is None and (scene.contact, scene.solver) == ('timestep', 'sequential'):
        return order_by_place(scene.model, scene.state)
    return np.arange(len(scene.names))
