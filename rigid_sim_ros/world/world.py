# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""World: the object that a Python user holds."""

from collections.abc import Mapping
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rigid_sim_ros.engine.model.model import WORLD
from rigid_sim_ros.engine.state.body_order import renumbered
from rigid_sim_ros.engine.state.frames import point_on_frame, vector_on_frame
from rigid_sim_ros.engine.state.state import (
    add_impulse, copy_into, copy_state, empty_motion, first_unfinite, MotionArguments,
    write_motion)
from rigid_sim_ros.engine.steps.contact_model import Setup
from rigid_sim_ros.engine.steps.contact_models import make_contact_model
from rigid_sim_ros.kernels.argument_pack import ArgumentPack
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.scene import read_scene, Scene, scene_from_dict
from rigid_sim_ros.world.applied_wrenches import AppliedWrenches
from rigid_sim_ros.world.bounds import (
    changes_of_twist, check_change, check_position, check_twist)
from rigid_sim_ros.world.changing import first_order
from rigid_sim_ros.world.posed import Posed
from rigid_sim_ros.world.saving import Saving
from rigid_sim_ros.world.snapshot_check import Sizes
from rigid_sim_ros.world.values import (
    duration_in_steps, some, source_name, step_count, unit_quaternion, vector)


def load_scene(scene: str | os.PathLike[str]) -> 'World':
    """
    Return the world of a scene file, or of an example scene by its name.

    SceneError, a ValueError, if the scene is wrong.
    """
    return World(read_scene(scene))


class World(Saving):
    """
    A world of rigid bodies that advances in fixed steps.

    Poses and twists are of the body frames, as the scene's author wrote them; vectors are in world
    axes and SI units; the twist's linear part is the velocity of the body frame's origin. The same
    scene with the same inputs at the same steps gives the same bits.

    Here are time, wrenches, impulses, poses and twists; the parts that it inherits, each on the
    next, are what can be read (readings.py), commands and who observes them (commands.py),
    joints, their drives and trajectories (joints.py, drives.py, trajectories.py), matrices of
    models (model_dynamics.py), what is added and removed (changing.py, changes.py, joining.py),
    and bytes of the state (saving.py, snapshot.py, snapshot_check.py).
    """

    def __init__(self, scene: Scene) -> None:
        """Put every body where the scene says."""
        super().__init__(scene)
        self._begin_commands()
        self._threads = 1
        self.step_index = 0
        self._set_up(scene, first_order(scene))

    def _set_up(self, scene: Scene, order: IntArray) -> None:
        """Hold the bodies of a scene from now on, in this order, as at their beginning."""
        self.scene = scene
        self.names: list[str] = list(scene.names)
        self.frame_names: dict[str, int] = dict(scene.frame_names)
        self.step_ns: int = scene.step_ns
        # Which body is in a row of the engine's arrays, and the row of a body.
        self._order: IntArray = order
        self._row: IntArray = np.argsort(self._order)
        self._model, self._start, self._shapes = renumbered(scene.model, scene.state, scene.shapes,
                                                            self._order, self._row)
        self._index = dict(zip(self.names, self._row.tolist(), strict=True))
        self._state = copy_state(self._start)
        self._applied = AppliedWrenches()
        self._posed = Posed(self._model, self._shapes)
        self._sizes = Sizes(len(self.names), len(self._model.frame_body),
                            len(self._model.fixed), self._shapes.body)
        self._bounds = scene.spec.world.bounds
        collision = scene.spec.collision
        self._contact = make_contact_model(scene.contact, Setup(
            self._model, self._shapes, scene.materials, scene.integrator, scene.orientation,
            scene.solver, collision.substeps, collision.sleep_after, self._joint_setup()))
        self._contact.use_threads(self._threads)
        self._motion = empty_motion(len(self.names))
        self._pack = ArgumentPack(MotionArguments(self._model, self._state, self._motion))
        self._motion_is_current = False
        self._begin_joints()

    @classmethod
    def from_dict(cls, scene: Mapping[str, Any]) -> 'World':
        """
        Return the world of a scene in the file's format, given as a dict.

        SceneError, a ValueError, if the scene is wrong.
        """
        return cls(scene_from_dict(scene))

    @property
    def threads(self) -> int:
        """
        How many threads a step may use; the bits of its results do not depend on it.

        A second one helps the contact model `timestep` while 512 pairs of shapes or more are near
        each other, and keeps a core busy as long as the world is stepped; more than two are not
        used, nor a second one on a single core. ValueError when it is set to anything but a whole
        number > 0.
        """
        return self._threads

    @threads.setter
    def threads(self, count: int) -> None:
        if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
            raise ValueError(f'threads {count!r}, must be a whole number > 0')
        self._threads = int(count)
        self._contact.use_threads(self._threads)

    # --- time ---------------------------------------------------------------------------------

    @property
    def time_ns(self) -> int:
        """Simulation time [ns], step_index * step_ns."""
        return self.step_index * self.step_ns

    def step(self, count: int = 1) -> None:
        """
        Advance by `count` fixed steps.

        ValueError when count is not a whole number >= 0; ArithmeticError when a body's motion has
        grown beyond all numbers, which a smaller step or softer forces mend.
        """
        # The usual case first: to ask for each type that is allowed takes 0.07 us more.
        left = count if type(count) is int and count >= 0 else step_count(count)
        self._motion_is_current = False
        applied = self._applied
        while left > 0:
            # Wrenches leave the book when their time is over, so that a step without any costs
            # nothing for them.
            batch = applied.steps_until_one_ends(left)
            if self._leads:
                batch = self._lead(batch)
            self._contact.advance(self._state, applied.wrenches, batch)
            applied.remove_finished()
            left -= batch
            self.step_index += batch
        broken = self._pack.run(first_unfinite)
        if broken >= 0:
            raise ArithmeticError(
                f"body '{self.names[self._order[broken]]}': its motion is no longer finite at "
                f'step {self.step_index}; use a step smaller than {self._model.h:g} s or softer '
                'forces')

    # --- inputs -------------------------------------------------------------------------------

    def apply_wrench(self, name: str, force: ArrayLike = (0.0, 0.0, 0.0),
                     torque: ArrayLike = (0.0, 0.0, 0.0), frame: str = 'world', *,
                     point: ArrayLike | None = None, duration: float | None = None,
                     source: str | None = None) -> None:
        """
        Let a force [N] and a torque [N m] act on a body from the next step on.

        Their axes are those of `frame`: 'world', a body ('crate') or a named frame
        ('crate/handle'), followed as it turns. The force acts at `point` [m], given in that frame;
        without one at the frame's origin if the frame belongs to the body itself, else at the
        centre of mass. `duration` [s] of simulation time is rounded to whole steps; None is the
        next step only. Wrenches add up; one with a `source` first ends what the same source
        applied before. ValueError for an unknown body or frame, for numbers that are not finite
        or, within a step, beyond the scene's bounds, for a duration below 0, and for a source that
        is no text.
        """
        source_name(source)     # a snapshot holds it
        body, F, f, t = (self._body(name), self._frame(frame), vector('force', force),
                         vector('torque', torque))
        p_F = self._point(body, F, point)
        self._check_change(body, F, p_F, self._model.h * f, self._model.h * t)
        self._apply(body, F, f, t, p_F, 1 if duration is None else duration_in_steps(
            duration, self._model.h), source)
        self._tell('apply_wrench', name=name, force=f, torque=t, frame=frame, point=point,
                   duration=duration, source=source)

    def _check_change(self, body: int, frame: int, p_F: Array | None, J_F: Array,
                      K_F: Array) -> None:
        """Raise ValueError for an impulse [N s], angular [N m s], of too much effect."""
        check_change(self._bounds, self.names[self._order[body]], *changes_of_twist(
            self._model, self._state, body, frame, p_F, J_F, K_F))

    def _apply(self, body: int, frame: int, force: Array, torque: Array, point: Array | None,
               steps: int, source: str | None) -> None:
        if source is not None:
            self._applied.remove(source)
        if steps > 0:
            self._applied.add(source or '', body, frame, point, force, torque, steps)

    def cancel_wrenches(self, source: str) -> None:
        """End what a source applied; ValueError for a source that is no text."""
        source_name(source)
        self._applied.remove(source)
        self._tell('cancel_wrenches', source=source)

    @property
    def wrench_sources(self) -> list[str]:
        """Who applied each wrench that is in effect, '' for nobody in particular."""
        return list(self._applied.sources)

    def apply_impulse(self, name: str, impulse: ArrayLike, *, point: ArrayLike | None = None,
                      frame: str = 'world') -> None:
        """
        Change a body's momenta at once by an impulse [N s] in the axes of `frame`.

        It acts at `point`, with the same rules as a wrench's. ValueError as for `apply_wrench`.
        """
        body, f = self._body(name), self._frame(frame)
        J = vector('impulse', impulse)
        p_F = self._point(body, f, point)
        self._check_change(body, f, p_F, J, np.zeros(3))
        p_W = tuple(self._state.x[:, body])
        if p_F is not None:
            p_W, _ = point_on_frame(self._model, self._state, f, tuple(p_F))
        J_W = vector_on_frame(self._model, self._state, f, tuple(J))
        add_impulse(self._model, self._state, body, p_W, J_W)
        self._pass_on(body)
        self._motion_is_current = False
        self._tell('apply_impulse', name=name, impulse=J, point=point, frame=frame)

    def set_pose(self, name: str, position: ArrayLike, orientation: ArrayLike) -> None:
        """
        Put the body frame of a body at a position [m] and an orientation x, y, z, w.

        It keeps its twist. A kinematic body without a twist, and a fixed one, moves there, and
        carries what lies on it: until the end of the next step, and when poses follow each other
        within 0.1 s, in as many steps as have passed since the last one. It is there at once if
        that would be a jump, see posed.py. ValueError for an unknown body, numbers that are not
        finite or beyond the scene's bounds, or a quaternion that is not of unit length.
        """
        body = self._body(name)
        p, q = vector('position', position), unit_quaternion(orientation)
        check_position(self._bounds, name, p)
        self._check_can_be_put(body)
        motion = self._current_motion()
        motion.position[body], motion.orientation[body] = p, q
        if self._model.inv_m[body] == 0.0:
            self._posed.put(self._state, motion, body, self.step_index)
            self._follow(body)
        else:
            self._put(body, motion)
        self._motion_is_current = False
        self._tell('set_pose', name=name, position=p, orientation=q)

    def set_twist(self, name: str, linear: ArrayLike, angular: ArrayLike) -> None:
        """
        Give a body frame a velocity [m/s] of its origin and an angular velocity [rad/s].

        Both in world axes. A kinematic body goes on with it until another one is set. ValueError
        for an unknown body, a fixed one, or numbers not finite or beyond the scene's bounds.
        """
        body = self._body(name)
        v, w = vector('linear velocity', linear), vector('angular velocity', angular)
        check_twist(self._bounds, name, v, w)
        if self.scene.spec.bodies[self._order[body]].fixed and (v.any() or w.any()):
            raise ValueError(f"body '{name}' is fixed and cannot be given the twist "
                             f'{v.tolist()}, {w.tolist()}: write `kinematic: true` in place of '
                             '`fixed: true` in the scene')
        motion = self._current_motion()
        motion.linear[body], motion.angular[body] = v, w
        if self._model.inv_m[body] == 0.0:
            self._posed.turn(self._state, motion, body)
        else:
            write_motion(self._model, self._state, motion, body)
        self._pass_on(body)
        self._motion_is_current = False
        self._tell('set_twist', name=name, linear=v, angular=w)

    def _body(self, name: str) -> int:
        try:
            return self._index[name]
        except (KeyError, TypeError):
            raise ValueError(f'body {name!r} does not exist, must be one of: '
                             f'{some(self.names)}') from None

    def _frame(self, frame: str) -> int:
        if frame in ('world', ''):
            return WORLD
        try:
            return self.frame_names[frame]
        except (KeyError, TypeError):
            raise ValueError(f"frame {frame!r} does not exist, must be 'world' or one of: "
                             f'{some(list(self.frame_names))}') from None

    def _point(self, body: int, frame: int, point: ArrayLike | None) -> Array | None:
        """Return where in a frame a force acts; None is the centre of mass."""
        if point is not None:
            return vector('point', point)
        own = frame != WORLD and self._model.frame_body[frame] == body
        return np.zeros(3) if own else None

    # --- the state as a whole -----------------------------------------------------------------

    def reset(self, keep_time: bool = False) -> None:
        """
        Put every body where it began and end all wrenches; time restarts at 0 unless kept.

        A body that was added begins as it was added.
        """
        copy_into(self._state, self._start)
        self._applied.clear()
        self._posed.clear()
        self._contact.recall({})
        self._begin_joints()
        self._motion_is_current = False
        step = self.step_index
        if not keep_time:
            self.step_index = 0
        self._tell('reset', step, keep_time=keep_time)
