# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Small scenes that once broke a law, each with what mechanics says of it.

They are kept in the same form as the laws, with a figure and what is allowed; a law that they
belong to asks the same of scenes that nobody chose.
"""

from collections.abc import Callable, Iterator
import math
import time
from typing import Any, NamedTuple

from laws.book import builder
from laws.motion import look, masses, Ours, potential, Run, Verdict, worst
from laws.scenes import any_attitude, body, fixed, G, matrix, plane, Spec, turn, world
from laws.solids import box, capsule, compound, cone, cylinder, ellipsoid, Solid, sphere
import numpy as np

MS = 1e-3
LEVEL = (0.0, 0.0, 0.0, 1.0)
UP = np.array((0.0, 0.0, 1.0))


class Case(NamedTuple):
    """A case, and how to measure it with a model and so many substeps."""

    letter: str
    name: str
    measure: Callable[[str], Verdict]
    models: tuple[str, ...] = ('timestep', 'event')


def _surface(friction: float = 0.5, restitution: float = 0.0) -> dict[str, float]:
    return {'friction': friction, 'restitution': restitution}


def _energy(spec: Spec, run: Run) -> float:
    of = masses(spec)
    now = look(of, run.motion())
    return float(now.kinetic.sum() + potential(spec, of, now))


# --- A: an inelastic impact rebounds -------------------------------------------------------------


def rebound(model: str, h: float = MS, substeps: int = 4, top: float = 1.0) -> Verdict:
    """Drop a cube by 0.5 m on one that rests on the ground; nothing may rise."""
    cube = box((1, 1, 1))
    spec = world([body('low', cube, 1.0, (0, 0, 0.5)), body('high', cube, top, (0, 0, 2.0)),
                  plane()], h, _surface())
    run, fastest = builder(model, substeps)(spec), 0.0
    for _ in range(math.ceil(1.0 / h)):
        run.step(1)
        fastest = max(fastest, float(run.motion()[:, 9].max()))
    return Verdict(fastest, 0.02 * math.sqrt(G) + G * h, 'm/s upwards')


# --- B: bodies that never touch ------------------------------------------------------------------


def pass_by(model: str, solid: Solid, speed: float, attitude: Any = LEVEL) -> Verdict:
    """Let a body pass a fixed box in space with a gap of 1 mm."""
    side = 0.1 + 1e-3 + solid.reach(matrix(attitude).T @ (-1.0, 0.0, 0.0))
    spec = world([body('passer', solid, 1.0, (side, -0.3, 0), attitude, (0, speed, 0)),
                  fixed('box', box((0.2, 0.2, 0.3)), (0, 0, 0))], MS, _surface(), (0, 0, 0))
    run = builder(model)(spec)
    run.step(math.ceil(0.6 / speed / MS))
    now = run.motion()[0]
    return Verdict(float(np.abs(now[7:] - (0, speed, 0, 0, 0, 0)).max()), 0.0,
                   'change of speed, m/s and rad/s')


# --- C: seams ------------------------------------------------------------------------------------


def seams(model: str, solid: Solid, attitude: Any, one: bool = False) -> Verdict:
    """Let a body without friction slide at 2 m/s over flush boxes of 0.5 m; it goes on."""
    height = solid.reach(matrix(attitude).T @ -UP)
    slider = body('slider', solid, 1.0, (-1.0, 0, height), attitude, (2.0, 0, 0))
    tiles = [(box((0.5, 2, 0.2)), (-1.25 + 0.5 * k, 0, -0.1)) for k in range(12)]
    floor = [fixed(f'tile{k}', *tile) for k, tile in enumerate(tiles)]
    if one:
        whole = compound(tiles)
        middle = -np.array(whole.shape['compound'][0]['pose']['position']) + tiles[0][1]
        floor = [fixed('floor', whole, middle)]
    run, lift = builder(model)(world([slider, *floor], MS, _surface(friction=0.0))), 0.0
    for _ in range(200):
        run.step(10)
        lift = max(lift, abs(float(run.motion()[0, 2]) - height))
    lost = abs(2.0 - float(run.motion()[0, 7]))
    # Nothing acts along the floor. Across it forces are known to a step: g h^2.
    return worst([Verdict(lost, 2e-6, 'm/s lost'), Verdict(lift, G * MS ** 2, 'm of lift')])


# --- D: a flat bounce makes spin -----------------------------------------------------------------


def flat_bounce(model: str, solid: Solid, restitution: float) -> Verdict:
    """Drop a body flat from 3 m; it does not turn after its first impact."""
    up = solid.reach(UP)
    spec = world([body('b', solid, 1.0, (0, 0, up + 3.0)), plane()], MS,
                 _surface(restitution=restitution))
    run = builder(model)(spec)
    run.step(math.ceil(math.sqrt(6.0 / G) / MS) + 2)
    return Verdict(float(np.abs(run.motion()[0, 10:]).max()), 1e-6 * math.sqrt(6.0 * G),
                   'rad/s after the first impact')


def bouncing_energy(model: str) -> Verdict:
    """Let an elastic cube fall flat from 3 m and bounce for 10 s; it gains nothing."""
    spec = world([body('b', box((1, 1, 1)), 1.0, (0, 0, 3.5)), plane()], MS,
                 _surface(restitution=1.0))
    run = builder(model)(spec)
    start, most = _energy(spec, run), 0.0
    for _ in range(200):
        run.step(50)
        most = max(most, _energy(spec, run) / start)
    return Verdict(most - 1.0, 1e-3, 'gain of energy, share')


# --- E: what rolls or rocks gains energy ---------------------------------------------------------


def rocking(model: str, h: float, seconds: float = 10.0) -> Verdict:
    """Let a ball rock whose centre of mass is 3 cm low; its energy stays."""
    ball, low = sphere(0.1), 0.03
    spec = world([body('b', ball, 1.0, (0, 0, 0.1), turn((1, 0, 0), 0.5), com=(0, 0, -low)),
                  plane()], h, _surface(friction=1.0))
    run, bottom = builder(model)(spec), G * (0.1 - low)
    start = _energy(spec, run) - bottom
    run.step(round(seconds / h))
    # It turns by at most w = sqrt(2 g low (1 - cos 0.5) / (2/5 r^2 + (r - low)^2)) = 2.8 rad/s.
    allowed = (2.8 * h) ** 2 + seconds / h * (2.8 * h) ** 3
    return Verdict(abs((_energy(spec, run) - bottom) / start - 1.0), allowed, 'of energy, share')


def disk(model: str) -> Verdict:
    """Let a disk roll at 20 degrees for a second, its centre at rest (Euler's disk)."""
    r, t, a = 0.1, 0.001, math.radians(20.0)
    rate = math.sqrt(4 * G / r / math.sin(a))
    attitude = turn((1, 0, 0), a)
    R, solid = matrix(attitude), cylinder(r, t)
    down = R @ (0.0, -1.0, 0.0)
    w = rate * math.sin(a) * down
    v = -np.cross(w, r * down - 0.5 * t * R[:, 2])
    spec = world([body('b', solid, 1.0, (0, 0, solid.reach(R.T @ -UP)), attitude, v, w), plane()],
                 MS, _surface(friction=1.0))
    run = builder(model)(spec)
    start = _energy(spec, run)
    run.step(1000)
    return Verdict(abs(_energy(spec, run) / start - 1.0),
                   (rate * MS) ** 2 + 1000 * (rate * MS) ** 3, 'of energy, share')


def rocking_ellipsoid(model: str) -> Verdict:
    """Let an ellipsoid rock for 10 s about its position of rest; its energy stays."""
    solid, q = ellipsoid((0.1, 0.15, 0.2)), turn((0, 1, 0), math.pi / 2 + 0.3)
    height = solid.reach(matrix(q).T @ -UP)
    spec = world([body('b', solid, 1.0, (0, 0, height), q), plane()], MS, _surface(friction=1.0))
    run, bottom = builder(model)(spec), G * 0.1
    start = _energy(spec, run) - bottom
    run.step(10_000)
    # It turns by at most sqrt(2 g (height - 0.1) / ((0.1^2 + 0.2^2) / 5 + 0.1^2)) = 3.5 rad/s.
    allowed = (3.5 * MS) ** 2 + 10_000 * (3.5 * MS) ** 3
    return Verdict(abs((_energy(spec, run) - bottom) / start - 1.0), allowed, 'of energy, share')


def rolling_cone(model: str, radius: float, length: float) -> Verdict:
    """Let a cone roll on its mantle around its apex for 5 s; the energy stays, and the apex."""
    solid, half = cone(radius, length), math.atan2(radius, length)
    q = turn((0, 1, 0), math.pi / 2 + half)
    apex = np.array((0.0, 0.0, 0.75 * length))  # from the centre of mass, in the body
    R, rate = matrix(q), 1.5
    place = -R @ apex
    # The line of contact turns about the vertical through the apex at `rate`.
    w = -rate / math.tan(half) * np.array((math.copysign(1.0, R[0, 2]), 0.0, 0.0))
    spec = world([body('b', solid, 1.0, place, q, np.cross(w, place), w), plane()], MS,
                 _surface(friction=1.0))
    run = builder(model)(spec)
    bottom = G * place[2]
    start = _energy(spec, run) - bottom
    run.step(5000)
    now, turns = run.motion()[0], float(np.linalg.norm(w)) * MS
    slipped = float(np.linalg.norm(now[:3] + matrix(now[3:7]) @ apex)) / length
    return worst([Verdict(abs((_energy(spec, run) - bottom) / start - 1.0),
                          turns ** 2 + 5000 * turns ** 3, 'of energy, share'),
                  Verdict(slipped, 5000 * turns ** 3, 'of its length that the apex moved')])


def resting(model: str, solid: Solid, attitude: Any = LEVEL) -> Verdict:
    """Put a body on the ground where it rests; it stays for 2 s."""
    height = solid.reach(matrix(attitude).T @ -UP)
    spec = world([body('b', solid, 1.0, (0, 0, height), attitude), plane()], MS, _surface())
    run = builder(model)(spec)
    start = run.motion()[0]
    run.step(2000)
    return Verdict(float(np.abs(run.motion()[0] - start).max()), G * MS ** 2,
                   'm, m/s or rad/s, of a body at rest')


# --- F: small things never rest ------------------------------------------------------------------


def small(model: str) -> Verdict:
    """Drop cubes of 1 to 5 mm at random attitudes; after 4 s all of them rest."""
    rng, fastest = np.random.default_rng(1), 0.0
    for _ in range(12):
        size = rng.uniform(1e-3, 5e-3)
        spec = world([body('b', box((size,) * 3), 1000.0 * size ** 3, (0, 0, 3 * size),
                           any_attitude(rng)), plane()], MS, _surface())
        run = builder(model)(spec)
        run.step(4000)
        for _ in range(20):
            run.step(5)
            fastest = max(fastest, float(np.abs(run.motion()[0, 7:10]).max()))
    # Speeds are known to g h at best; a cube of 1 mm has sqrt(g size) = 0.1 m/s.
    return Verdict(fastest, 0.01 * math.sqrt(G * 1e-3), 'm/s after 4 s')


# --- G: a fixed body that is moved ---------------------------------------------------------------


def carried(model: str, velocity: tuple[float, float, float]) -> Verdict:
    """Move the floor by set_pose; after half a second the cube on it moves with it."""
    spec = world([body('b', box((0.2, 0.2, 0.2)), 1.0, (0, 0, 0.1)),
                  fixed('floor', box((10, 10, 0.2)), (0, 0, -0.1))], MS, _surface())
    run = builder(model)(spec)
    if not isinstance(run, Ours):
        return Verdict(math.nan, 0.0, 'not asked')
    v, thrown = np.array(velocity), 0.0
    for k in range(1, 501):
        run.world.set_pose('floor', v * k * MS - (0, 0, 0.1), LEVEL)
        run.step(1)
        thrown = max(thrown, float(run.motion()[0, 9]) - max(0.0, v[2]))
    now = run.motion()[0]
    # It slips until its speed is the floor's: mu g t.
    late = np.abs(v[:2]) / (0.5 * G)
    expected = v * 0.5 - np.append(0.5 * v[:2] * late, 0.0)
    wrong = max(thrown, float(np.abs(now[7:10] - v).max()),
                float(np.abs(now[:3] - (0, 0, 0.1) - expected).max()))
    return Verdict(wrong, 2 * G * MS, 'm/s or m apart from the floor')


# --- H: slow where it should not be --------------------------------------------------------------


def _arch() -> Spec:
    """Return an arch of 15 stones, with too little friction to stand."""
    count, r = 15, 1.0
    stones = []
    for k in range(count):
        angle = math.pi * (k + 0.5) / count
        size = (2 * (r + 0.1) * math.tan(0.5 * math.pi / count) * 0.9, 0.3, 0.2)
        place = (r * 1.1 * math.cos(angle), 0.0, r * 1.1 * math.sin(angle) + 0.05)
        stones.append(body(f's{k}', box(size), 1.0, place,
                           turn((0, 1, 0), 0.5 * math.pi - angle)))
    return world([*stones, plane()], MS, _surface(friction=0.1))


def duration(model: str, spec: Spec, steps: int, allowed: float = 5.0) -> Verdict:
    """Measure the time of a step [ms], in the longest of the stretches of ten."""
    run, most = builder(model)(spec), 0.0
    run.step(1)
    for _ in range(steps // 10):
        start = time.perf_counter()
        run.step(10)
        most = max(most, (time.perf_counter() - start) / 10)
    return Verdict(1e3 * most, allowed, 'ms a step')


def overlapping() -> Spec:
    """Return two cubes that overlap by 10 cm."""
    cube = box((1, 1, 1))
    return world([body('a', cube, 1.0, (0, 0, 0.5)), body('b', cube, 1.0, (0, 0, 1.4)), plane()],
                 MS, _surface())


# --- I: heavy on light ---------------------------------------------------------------------------


def heavy(model: str) -> Verdict:
    """Put 10 000 kg on 1 kg; the ground bears both, and nothing sinks."""
    cube = box((1, 1, 1))
    spec = world([body('low', cube, 1.0, (0, 0, 0.5)), body('high', cube, 1e4, (0, 0, 1.5)),
                  plane()], MS, _surface())
    run = builder(model)(spec)
    run.step(1000)
    force = -float(run.force_on('ground')[2]) / (10001.0 * G)
    sunk = float(np.abs(run.motion()[:2, 2] - (0.5, 1.5)).max())
    return Verdict(max(abs(force - 1.0), sunk), 1e-3, 'of the weight, or m sunk')


def _cases() -> Iterator[Case]:
    for h, words in ((MS, '1 ms'), (1 / 60, '1/60 s'), (1e-4, '0.1 ms')):
        yield Case('A', f'rebound of a cube on a cube, {words}',
                   lambda model, h=h: rebound(model, h))
    yield Case('A', 'the same, 16 substeps', lambda model: rebound(model, substeps=16),
               ('timestep',))
    yield Case('A', 'the same, 100 kg on 1 kg', lambda model: rebound(model, top=100.0))
    for solid, v in ((box((0.03,) * 3), 3.0), (cylinder(0.015, 0.03), 3.0), (sphere(0.015), 10.0)):
        yield Case('B', f"a {solid.shape['type']} passes a box at {v:g} m/s",
                   lambda model, solid=solid, v=v: pass_by(model, solid, v))
    lying = turn((1, 0, 0), math.pi / 2)
    yield Case('B', 'a lying cylinder passes a box at 3 m/s',
               lambda model: pass_by(model, cylinder(0.015, 0.03), 3.0, lying))
    for name, solid, q in (('cube', box((0.2,) * 3), LEVEL), ('ball', sphere(0.1), LEVEL),
                           ('capsule', capsule(0.1, 0.2), lying),
                           ('standing cylinder', cylinder(0.1, 0.2), LEVEL)):
        yield Case('C', f'a {name} slides over flush boxes',
                   lambda model, solid=solid, q=q: seams(model, solid, q))
    yield Case('C', 'a cube slides over a compound of boxes',
               lambda model: seams(model, box((0.2,) * 3), LEVEL, one=True))
    yield Case('D', 'an elastic cube falls flat', lambda m: flat_bounce(m, box((1, 1, 1)), 1.0))
    yield Case('D', 'a cylinder falls flat, restitution 0.9',
               lambda m: flat_bounce(m, cylinder(0.5, 1.0), 0.9))
    yield Case('D', 'an elastic cube bounces for 10 s', bouncing_energy)
    yield Case('E', 'a ball rocks, 1 ms, 10 s', lambda model: rocking(model, MS))
    yield Case('E', 'a ball rocks, 1 ms, 60 s', lambda model: rocking(model, MS, 60.0))
    yield Case('E', 'a ball rocks, 1/240 s, 10 s', lambda model: rocking(model, 1 / 240))
    yield Case('E', "Euler's disk at 20 degrees, 1 s", disk)
    yield Case('E', 'an ellipsoid rocks, 1 ms, 10 s', rocking_ellipsoid)
    for radius, length in ((0.1, 0.2), (0.1, 0.35), (0.2, 0.15)):
        yield Case('E', f'a cone of {radius:g} m and {length:g} m rolls around its apex, 5 s',
                   lambda model, r=radius, h=length: rolling_cone(model, r, h))
    egg = ellipsoid((0.1, 0.15, 0.2))
    for name, solid, q in (('cone on its base', cone(0.1, 0.2), LEVEL),
                           ('cone on its mantle', cone(0.1, 0.2),
                            turn((0, 1, 0), math.pi / 2 + math.atan2(0.1, 0.2))),
                           ('ellipsoid', egg, turn((0, 1, 0), math.pi / 2)),
                           ('spheroid', ellipsoid((0.2, 0.2, 0.1)), LEVEL)):
        yield Case('F', f'a {name} rests',
                   lambda model, solid=solid, q=q: resting(model, solid, q))
    yield Case('F', 'cubes of 1 to 5 mm come to rest', small)
    for v, words in (((0.0, 0.0, -1.0), 'down'), ((0.0, 0.0, 1.0), 'up'),
                     ((1.0, 0.0, 0.0), 'sideways')):
        yield Case('G', f'a floor that set_pose moves {words} at 1 m/s',
                   lambda model, v=v: carried(model, v))
    yield Case('H', 'two cubes that overlap by 10 cm',
               lambda model: duration(model, overlapping(), 200), ('event',))
    yield Case('H', 'an arch of 15 stones that collapses',
               lambda model: duration(model, _arch(), 300), ('event',))
    one = world([body('b', box((1, 1, 1)), 1.0, (0, 0, 0.5)), plane()], MS, _surface())
    yield Case('H', 'one box at rest', lambda model: duration(model, one, 200, 0.1), ('penalty',))
    tiny = world([body('b', box((3e-3,) * 3), 1e-3, (0, 0, 3e-3), turn((1, 1, 0), 0.7)), plane()],
                 MS, _surface())
    yield Case('H', 'a cube of 3 mm', lambda model: duration(model, tiny, 200), ('qp',))
    yield Case('I', '10 000 kg on 1 kg', heavy)


CASES = tuple(_cases())
