# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dampers in loops: what they do is the same whichever joint the engine takes to close a loop."""

import numpy as np
import pytest

from rigid_sim_ros import World

# Corners of a four-bar linkage in the plane y = 0 [m].
CORNERS = np.array([(0.0, 0.0), (0.1, 0.4), (0.7, 0.5), (0.6, 0.0)])


def linkage(order, damping):
    """Return a linkage of three bars, released; the first hinge on the world is damped."""
    bodies, hinges = [], {}
    for n, name in enumerate('abc'):
        middle = 0.5 * (CORNERS[n] + CORNERS[n + 1])
        bodies.append({'name': name, 'pose': {'position': [middle[0], 0.0, middle[1]]},
                       'inertial': {'mass': 1.0 + n, 'inertia': [0.05, 0.05, 0.05, 0, 0, 0]}})
    ends = ['world', 'a', 'b', 'c', 'world']
    for n, name in enumerate(('wa', 'ab', 'bc', 'cw')):
        parent, child = (ends[n], ends[n + 1]) if n < 3 else ('world', 'c')
        at = CORNERS[n]
        if parent != 'world':
            at = at - 0.5 * (CORNERS[n - 1] + CORNERS[n])
        hinges[name] = {'name': name, 'type': 'continuous', 'parent': parent, 'child': child,
                        'pose': {'position': [at[0], 0.0, at[1]]}, 'axis': [0, 1, 0]}
    hinges['wa']['damping'] = damping
    return World.from_dict({'world': {'contact': 'none', 'step': 0.002}, 'bodies': bodies,
                            'joints': [hinges[name] for name in order]})


@pytest.mark.parametrize('order', [('cw', 'bc', 'wa', 'ab'), ('wa', 'cw', 'ab', 'bc')])
def test_a_damper_that_is_too_fast_for_the_step_acts_alike_in_each_tree(order):
    # z = h d / I = 0.002 * 1000 / 0.2 = 10 > 2: 1 - 1/z of it acts in the second half, with I what
    # its axis feels.
    found = []
    for joints in (('wa', 'ab', 'bc', 'cw'), order):
        world = linkage(joints, 1e3)
        moved = []
        for _ in range(100):
            world.step()
            moved.append(world.position.copy())
        found.append(np.array(moved))
    turned = np.abs(found[0][-1] - found[0][0]).max()
    assert turned > 1e-5
    # The joints hold to 1e-13 m in each step.
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-11)
