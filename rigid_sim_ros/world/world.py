# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""World: the object that a Python user holds."""

from collections.abc import Mapping, Sequence
import hashlib
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rigid_sim_ros.engine.dynamics.forces import add_gravity, add_scene_forces
from rigid_sim_ros.engine.dynamics.loads import empty_loads
from rigid_sim_ros.engine.model.model import WORLD
from rigid_sim_ros.engine.state.body_order import order_by_place, renumbered
from rigid_sim_ros.engine.state.frames import point_on_frame, vector_on_frame
from rigid_sim_ros.engine.state.state import (
    add_impulse, BodyMotion, copy_into, copy_state, empty_motion, first_unfinite, kinetic_energy,
    MOVING_FIELDS, read_motion, total_angular_momentum, write_motion)
from rigid_sim_ros.engine.steps.contact_models import ContactReport, make_contact_model, Setup
from rigid_sim_ros.kernels.argument_pack import Kept
from rigid_sim_ros.kernels.arrays import Array, IntArray
from rigid_sim_ros.scene import read_scene, Scene, scene_from_dict
from rigid_sim_ros.world.applied_wrenches import AppliedWrenches, FIELDS
from rigid_sim_ros.world.bounds import check_change, check_position, check_twist
from rigid_sim_ros.world.joints import WithJoints
from rigid_sim_ros.world.posed import FIELDS as POSED_FIELDS, Posed
from rigid_sim_ros.world.snapshot import pack, unpack
from rigid_sim_ros.world.snapshot_check import check, Sizes

# A quaternion this near to unit length is normalised, one farther off is refused: rounding to
# three digits passes, a typo does not.
UNIT_TOLERANCE = 1e-3


def load_scene(scene: str | os.PathLike[str]) -> 'World':
    """
    Return the world of a scene file, or of an example scene by its name.

    SceneError, a ValueError, if the scene is wrong.
    """
    return World(read_scene(scene))


class World(WithJoints):
    """
    A world of rigid bodies that advances in fixed steps.

    Poses and twists are of the body frames, as the scene's author wrote them; vectors are in world
    axes and SI units; the twist's linear part is the velocity of the body frame's origin. The same
    scene with the same inputs at the same steps gives the same bits.
    """

    def __init__(self, scene: Scene) -> None:
        """Put every body where the scene says."""
        self.scene = scene
        self.names: list[str] = list(scene.names)
        self.frame_names: dict[str, int] = dict(scene.frame_names)
        self.step_index = 0
        self.step_ns: int = scene.step_ns
        # Which body is in a row of the engine's arrays, and the row of a body.
        self._order: IntArray = _order(scene)
        self._row: IntArray = np.argsort(self._order)
        self._model, self._start, shapes = renumbered(scene.model, scene.state, scene.shapes,
                                                      self._order, self._row)
        self._index = dict(zip(self.names, self._row.tolist(), strict=True))
        self._state = copy_state(self._start)
        self._applied = AppliedWrenches()
        self._posed = Posed(self._model, shapes)
        self._sizes = Sizes(len(self.names), len(self._model.frame_body),
                            len(self._model.fixed), shapes.body)
        self._bounds = scene.spec.world.bounds
        collision = scene.spec.collision
        self._contact = make_contact_model(scene.contact, Setup(
            self._model, shapes, scene.materials, scene.integrator, scene.orientation,
            scene.solver, collision.substeps, collision.sleep_after, self._joint_setup()))
        self._motion = empty_motion(len(self.names))
        self._box = Kept().box(self._model, self._state, self._motion)
        self._motion_is_current = False
        self._threads = 1
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
        left = count if type(count) is int and count >= 0 else _step_count(count)
        self._motion_is_current = False
        applied = self._applied
        while left > 0:
            # Wrenches leave the book when their time is over, so that a step without any costs
            # nothing for them.
            batch = applied.steps_until_one_ends(left)
            self._contact.advance(self._state, applied.room, batch)
            applied.remove_finished()
            left -= batch
            self.step_index += batch
        broken = self._box.run(first_unfinite)
        if broken >= 0:
            raise ArithmeticError(
                f"body '{self.names[self._order[broken]]}': its motion is no longer finite at "
                f'step {self.step_index}; use a step smaller than {self._model.h:g} s or softer '
                'forces')

    # --- motion -------------------------------------------------------------------------------

    def _current_motion(self) -> BodyMotion:
        if not self._motion_is_current:
            self._box.run(read_motion)
            self._motion_is_current = True
        return self._motion

    def _by_body(self, columns: Array) -> Array:
        """Return a row for each body, in the order of `names`."""
        return np.take(columns.T, self._row, axis=0)

    @property
    def position(self) -> Array:
        """Origins of the body frames, (n, 3) [m], world axes."""
        return self._current_motion().position[self._row]

    @property
    def orientation(self) -> Array:
        """Orientations of the body frames, (n, 4) x, y, z, w, body to world."""
        return self._current_motion().orientation[self._row]

    @property
    def linear_velocity(self) -> Array:
        """Velocities of the origins of the body frames, (n, 3) [m/s], world axes."""
        return self._current_motion().linear[self._row]

    @property
    def angular_velocity(self) -> Array:
        """Angular velocities, (n, 3) [rad/s], world axes."""
        return self._current_motion().angular[self._row]

    @property
    def linear_momentum(self) -> Array:
        """Linear momenta P = M v, (n, 3) [kg m/s], world axes."""
        return self._by_body(self._state.P)

    @property
    def angular_momentum(self) -> Array:
        """Angular momenta L = I w about the centres of mass, (n, 3) [kg m^2/s], world axes."""
        return self._by_body(self._state.L)

    @property
    def center_of_mass(self) -> Array:
        """Centres of mass, (n, 3) [m], world axes."""
        return self._by_body(self._state.x)

    @property
    def mass(self) -> Array:
        """Masses, (n,) [kg]; 0 for a fixed body that was given none."""
        return self._model.m[self._row]

    def kinetic_energy(self) -> float:
        """Return the kinetic energy of all bodies, and of what turns in joints [J]."""
        return float(kinetic_energy(self._model, self._state)) + self._armature_energy()

    def potential_energy(self) -> float:
        """Return the potential energy of gravity, of the scene's forces and of springs [J]."""
        loads = empty_loads(len(self.names))
        return float(add_gravity(self._model, self._state, loads)
                     + add_scene_forces(self._model, self._state, loads)) + self._spring_energy()

    def total_momentum(self) -> Array:
        """Return the linear momentum of all bodies, (3,) [kg m/s]."""
        return np.asarray(self._state.P.sum(axis=1))

    def total_angular_momentum(self) -> Array:
        """Return the angular momentum of all bodies about the world origin, (3,) [kg m^2/s]."""
        return np.array(total_angular_momentum(self._state))

    # --- contacts -----------------------------------------------------------------------------

    def contacts(self) -> np.ndarray:
        """
        Return the contact points of the latest step as a structured array.

        Its fields are body_a and body_b (indices into `names`), point [m], normal (unit vector
        from a to b), gap [m] (below 0: overlap), normal_force [N] and friction_force (3) [N on b],
        all in world axes. Forces are means over the step. A point without a force is near, but
        does not touch.
        """
        rows = self._contact.contacts(self._state)
        for body in ('body_a', 'body_b'):
            rows[body] = self._order[rows[body]]
        return rows

    def contact_wrenches(self) -> Array:
        """
        Return force [N] and torque [N m] of the contacts on each body, (n, 6), world axes.

        The torques are about the centres of mass.
        """
        rows = self.contacts()
        force = rows['normal_force'][:, None] * rows['normal'] + rows['friction_force']
        wrenches, x = np.zeros((len(self.names), 6)), self.center_of_mass
        for sign, body in ((-1.0, rows['body_a']), (1.0, rows['body_b'])):
            arm = rows['point'] - x[body]
            np.add.at(wrenches, body, sign * np.concatenate(
                [force, np.cross(arm, force)], axis=1))
        return wrenches

    def contact_report(self) -> ContactReport:
        """Return counts of pairs and contacts, the deepest overlap and the solver's residual."""
        return self._contact.report()

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
        or, within a step, beyond the scene's bounds, and for a duration below 0.
        """
        body, f, t = self._body(name), _vector('force', force), _vector('torque', torque)
        self._check_change(body, self._model.h * f, self._model.h * t)
        self._apply(body, self._frame(frame), f, t,
                    None if point is None else _vector('point', point), self._steps(duration),
                    source)

    def _check_change(self, body: int, J: Array, K: Array) -> None:
        """Raise ValueError for an impulse [N s] and an angular one [N m s] beyond all bounds."""
        with np.errstate(over='ignore'):        # infinity is beyond them too
            linear = J * self._model.inv_m[body]
            angular = K * self._model.inv_I_C[:, body].max()
        check_change(self._bounds, self.names[self._order[body]], linear, angular)

    def _apply(self, body: int, frame: int, force: Array, torque: Array, point: Array | None,
               steps: int, source: str | None) -> None:
        if source is not None:
            self._applied.remove(source)
        if steps > 0:
            self._applied.add(source or '', body, frame, self._point(body, frame, point), force,
                              torque, steps)

    def cancel_wrenches(self, source: str) -> None:
        """End what a source applied."""
        self._applied.remove(source)

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
        J = _vector('impulse', impulse)
        self._check_change(body, J, np.zeros(3))
        p_F = self._point(body, f, None if point is None else _vector('point', point))
        p_W = tuple(self._state.x[:, body])
        if p_F is not None:
            p_W, _ = point_on_frame(self._model, self._state, f, tuple(p_F))
        J_W = vector_on_frame(self._model, self._state, f, tuple(J))
        add_impulse(self._model, self._state, body, p_W, J_W)
        self._pass_on(body)
        self._motion_is_current = False

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
        p, q = _vector('position', position), _unit_quaternion(orientation)
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

    def set_twist(self, name: str, linear: ArrayLike, angular: ArrayLike) -> None:
        """
        Give a body frame a velocity [m/s] of its origin and an angular velocity [rad/s].

        Both in world axes. A kinematic body goes on with it until another one is set. ValueError
        for an unknown body, a fixed one, or numbers not finite or beyond the scene's bounds.
        """
        body = self._body(name)
        v, w = _vector('linear velocity', linear), _vector('angular velocity', angular)
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

    def _body(self, name: str) -> int:
        try:
            return self._index[name]
        except (KeyError, TypeError):
            raise ValueError(f'body {name!r} does not exist, must be one of: '
                             f'{_some(self.names)}') from None

    def _frame(self, frame: str) -> int:
        if frame in ('world', ''):
            return WORLD
        try:
            return self.frame_names[frame]
        except (KeyError, TypeError):
            raise ValueError(f"frame {frame!r} does not exist, must be 'world' or one of: "
                             f'{_some(list(self.frame_names))}') from None

    def _point(self, body: int, frame: int, point: Array | None) -> Array | None:
        """Return where in a frame a force acts; None is the centre of mass."""
        if point is None and frame != WORLD and self._model.frame_body[frame] == body:
            return np.zeros(3)
        return point

    def _steps(self, duration: float | None) -> int:
        if duration is None:
            return 1
        if not 0.0 <= duration < float('inf'):
            raise ValueError(f'duration {duration!r} s, must be finite and >= 0')
        return round(min(duration / self._model.h, 2.0 ** 62))

    # --- the state as a whole -----------------------------------------------------------------

    def _fingerprint(self) -> str:
        return hashlib.blake2b(self.scene.text.encode(), digest_size=8).hexdigest()

    def _order_mark(self) -> str:
        """Return what tells orders of the bodies apart, nothing for that of the scene."""
        if np.array_equal(self._order, np.arange(len(self._order))):
            return ''
        return hashlib.blake2b(self._order.tobytes(), digest_size=8).hexdigest()

    def _dynamic(self) -> dict[str, np.ndarray]:
        """Return every array that the next step depends on, by name."""
        moving = {name: getattr(self._state, name) for name in MOVING_FIELDS}
        return {**moving, **self._posed.rows(self._state), **self._applied.rows(),
                **self._contact.lasting()}

    def state_hash(self) -> int:
        """Return 64 bits that identify the complete dynamic state, time included."""
        digest = hashlib.blake2b(self.step_index.to_bytes(8, 'little'), digest_size=8)
        for array in self._dynamic().values():
            digest.update(array.tobytes())
        return int.from_bytes(digest.digest(), 'little')

    def save(self) -> bytes:
        """Return the complete dynamic state, for `restore` in a world of the same scene."""
        meta = {'scene': self._fingerprint(), 'bodies': len(self.names),
                'step_index': self.step_index, 'sources': self._applied.sources,
                'order': self._order_mark()}
        return pack(meta, self._dynamic())

    def restore(self, data: bytes) -> None:
        """
        Continue from what `save` returned, bit for bit.

        ValueError if it belongs to another scene, is damaged, or holds anything that no world of
        this scene can be in; then this one stays as it is.
        """
        meta, arrays = unpack(data)
        if meta.get('scene') != self._fingerprint():
            raise ValueError(
                f"the snapshot of {meta.get('bodies')!r:.20} bodies is of another scene than this "
                f'one of {len(self.names)} ({_some(self.names)}): restore it into a world of its '
                'own')
        if meta.get('order', '') != self._order_mark():
            raise ValueError('the snapshot numbers the bodies in another way: it was saved by '
                             'another version; run the scene from its start')
        check(meta, arrays, self._dynamic(), self._sizes, self.step_ns)
        # First what may still be refused, so that a refusal changes nothing.
        self._contact.recall({name: array for name, array in arrays.items()
                              if name not in MOVING_FIELDS + POSED_FIELDS + FIELDS})
        copy_into(self._state, self._start._replace(**{name: arrays[name]
                                                       for name in MOVING_FIELDS}))
        self._posed.replace(self._state, arrays)
        self._applied.replace({name: arrays[name] for name in FIELDS}, meta['sources'])
        self.step_index = meta['step_index']
        self._motion_is_current = False

    def reset(self, keep_time: bool = False) -> None:
        """Return to the initial state, wrenches ended; time restarts at 0 unless kept."""
        copy_into(self._state, self._start)
        self._applied.clear()
        self._posed.clear()
        self._contact.recall({})
        self._begin_joints()
        self._motion_is_current = False
        if not keep_time:
            self.step_index = 0


def _order(scene: Scene) -> IntArray:
    """Return the order in which the engine has the bodies of a scene."""
    if (scene.contact, scene.solver) == ('timestep', 'sequential'):
        return order_by_place(scene.model, scene.state)
    return np.arange(len(scene.names))


def _step_count(count: Any) -> int:
    """Return a number of steps, or raise ValueError."""
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 0:
        raise ValueError(f'step count {count!r}, must be a whole number >= 0')
    return int(count)


def _some(names: Sequence[str]) -> str:
    """Return the names for a message, the first few if they are many."""
    return ', '.join(names[:8]) + (f', ... ({len(names)} in all)' if len(names) > 8 else '')


def _vector(what: str, value: ArrayLike) -> Array:
    """Return three finite numbers, or raise ValueError."""
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f'{what} {value!r}, must be three numbers') from None
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f'{what} {vector.tolist()!r}, must be three finite numbers')
    return vector


def _unit_quaternion(value: ArrayLike) -> Array:
    """Return a unit quaternion, or raise ValueError if the value is not near one."""
    try:
        q = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f'orientation {value!r}, must be four numbers x, y, z, w') from None
    length = float(np.sqrt((q * q).sum())) if q.shape == (4,) else float('nan')
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise ValueError(f'orientation {q.tolist()!r}, must be x, y, z, w of length 1')
    return q / length
