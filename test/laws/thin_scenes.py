# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Scenes of thin bodies: needles, rods, plates, cards, discs and lenses.

Their moments of inertia differ by up to a million, and what they measure across is less than the
way of a step: a turn of a tenth of a radian moves the end of a needle by a hundred thicknesses.
"""

from collections.abc import Callable

from laws.scenes import (
    any_attitude, between, body, direction, draw_masses, draw_scales, draw_surface, plane, Scene,
    world)
from laws.solids import (
    box, capsule, compound, cone, cylinder, ellipsoid, Generator, POLYHEDRA, polyhedron, Solid)
import numpy as np

THICKNESS = 1e-3, 1 / 30  # over the length


def draw_bar(rng: Generator, size: float) -> Solid:
    """Draw a needle or a slat: long along x."""
    thick = size * between(rng, *THICKNESS)
    return box((size, thick * between(rng, 1.0, 5.0), thick))


def draw_plate(rng: Generator, size: float) -> Solid:
    """Draw a plate or a card, thin along z."""
    return box((size, size * between(rng, 0.3, 1.0), size * between(rng, *THICKNESS)))


def draw_disc(rng: Generator, size: float) -> Solid:
    """Draw a flat disc."""
    return cylinder(0.5 * size, size * between(rng, *THICKNESS))


def draw_rod(rng: Generator, size: float) -> Solid:
    """Draw a long cylinder or capsule."""
    round_ends = rng.random() < 0.5
    return (capsule if round_ends else cylinder)(0.5 * size * between(rng, *THICKNESS), size)


def draw_cone(rng: Generator, size: float) -> Solid:
    """Draw a thorn, or a cone as flat as a disc."""
    thick = size * between(rng, *THICKNESS)
    return cone(0.5 * thick, size) if rng.random() < 0.5 else cone(0.5 * size, thick)


def draw_ellipsoid(rng: Generator, size: float) -> Solid:
    """Draw an ellipsoid as long as a needle or as flat as a lens."""
    radii = 0.5 * size * np.array((1.0, 1.0, between(rng, *THICKNESS)))
    if rng.random() < 0.5:
        radii[1] = radii[2]
    return ellipsoid(radii)


def draw_polyhedron(rng: Generator, size: float) -> Solid:
    """Draw a splinter or a scale: a stretched tetrahedron, octahedron or wedge."""
    vertices, faces = POLYHEDRA[rng.integers(len(POLYHEDRA))]
    stretch = np.array((1.0, between(rng, 0.3, 1.0), between(rng, *THICKNESS)))
    if rng.random() < 0.5:
        stretch[1] = stretch[2]
    return polyhedron(0.5 * size * np.array(vertices) * stretch, faces)


def draw_frame(rng: Generator, size: float) -> Solid:
    """Draw an L or a T of two bars."""
    thick = size * between(rng, *THICKNESS)
    one, other = box((size, thick, thick)), box((thick, thick, size))
    return compound([(one, (0.0, 0.0, 0.0)),
                     (other, (0.5 * (size - thick) * rng.integers(2), 0.0, 0.5 * (size + thick)))])


DRAW = (draw_bar, draw_plate, draw_disc, draw_rod, draw_cone, draw_ellipsoid, draw_polyhedron,
        draw_frame)


def one_of(*kinds: Callable[[Generator, float], Solid]) -> Callable[[Generator, float], Solid]:
    """Return what draws a solid of one of some kinds."""
    def draw(rng: Generator, size: float) -> Solid:
        return kinds[rng.integers(len(kinds))](rng, size)
    return draw


draw_thin = one_of(*DRAW)
# Those that lie on a side, and whose top is one.
draw_flat = one_of(draw_bar, draw_plate, draw_disc)
# Those that do not roll.
draw_angular = one_of(draw_bar, draw_plate, draw_polyhedron, draw_frame)


def draw_thin_resting(rng: Generator) -> Scene:
    """Draw a body that falls on the ground and comes to rest, on a side or on an edge."""
    scales = draw_scales(rng, coarsest=0.2)
    solid = draw_angular(rng, scales.size)
    z = solid.radius + scales.size * between(rng, 1e-3, 0.3)
    bodies = [body('b0', solid, draw_masses(rng, 1)[0], (0, 0, z), any_attitude(rng)), plane()]
    surface = draw_surface(rng, restitution=0.0, friction=rng.uniform(0.3, 1.5))
    return Scene(world(bodies, scales.h, surface), scales.size, scales.steps(20.0),
                 {'count': 1, 'comes': True})


def draw_flight(rng: Generator) -> Scene:
    """Draw bodies that fly at each other in free space and turn by up to some radians a step."""
    h, size = float(rng.choice((1 / 60, 1 / 240, 1e-3))), between(rng, 0.05, 1.0)
    draw = (draw_bar, draw_plate, draw_disc, draw_rod, draw_thin)[rng.integers(5)]
    turn = between(rng, 0.02, 2.0) / h
    speed, bodies = 0.5 * turn * size * rng.uniform(0.1, 1.0), []
    for k, mass in enumerate(draw_masses(rng, int(rng.integers(2, 6)))):
        n = direction(rng)
        v = speed * (0.1 * rng.normal(size=3) - rng.uniform(0.5, 2.0) * n)
        # On shells that are farther from each other than a body reaches.
        bodies.append(body(f'b{k}', draw(rng, size), mass, 1.2 * size * (k + 0.5) * n,
                           any_attitude(rng), v, 0.5 * turn * rng.normal(size=3)))
    return Scene(world(bodies, h, draw_surface(rng), gravity=(0.0, 0.0, 0.0)), size, 60)
