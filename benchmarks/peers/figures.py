# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Figures of quality from where an engine put the bodies: the same formulas for every engine.

Overlaps are geometry of the poses, not what an engine says of itself: between balls the distance
of the centres, between boxes the least overlap along the 15 axes that can part two boxes
(Gottschalk et al., OBBTree, SIGGRAPH 1996).
"""

from collections.abc import Callable
import math
from typing import Any

import numpy as np
from scenes import G, SLOPE
from scipy.spatial import cKDTree

# The attitude of the body of `torque_free` after 100 s, x, y, z, w: Taylor series of order 24 with
# numbers of 34 digits.
AFTER_100_S = np.array((-0.00033532024701064178, 0.69467618661934152, 0.0065696244258204497,
                        0.71929251583653713))
# Overlaps are looked for in every fourth look: every 96 steps of the heaps.
STRIDE = 4


def rotations(q: np.ndarray) -> np.ndarray:
    """Return matrices (n, 3, 3), body to world, of quaternions (n, 4) x, y, z, w."""
    x, y, z, w = (q / np.linalg.norm(q, axis=1)[:, None]).T
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
    return np.moveaxis(np.array(rows), 2, 0)


def _boxes(p: np.ndarray, R: np.ndarray, half: np.ndarray, a: np.ndarray,
           b: np.ndarray) -> np.ndarray:
    """Return the overlap of box a[i] with box b[i]; below 0 they are apart."""
    columns_a, columns_b = np.moveaxis(R[a], 2, 1), np.moveaxis(R[b], 2, 1)
    crossed = np.cross(columns_a[:, :, None], columns_b[:, None]).reshape(-1, 9, 3)
    axes = np.concatenate([columns_a, columns_b, crossed], axis=1)
    length = np.linalg.norm(axes, axis=2)
    parallel = length < 1e-6
    axes = axes / np.where(parallel, 1.0, length)[:, :, None]
    reach = (np.abs(np.einsum('nac,nkc->nak', axes, columns_a)) @ half[a][:, :, None]
             + np.abs(np.einsum('nac,nkc->nak', axes, columns_b)) @ half[b][:, :, None])
    overlap = reach[:, :, 0] - np.abs(np.einsum('nac,nc->na', axes, p[b] - p[a]))
    return np.where(parallel, np.inf, overlap).min(axis=1)


def deepest(scene: dict[str, Any], look: np.ndarray) -> float:
    """Return the deepest overlap [m] of bodies of one kind, with each other or the ground."""
    p, R = look[:, :3], rotations(look[:, 3:7])
    ball = scene['bodies'][0]['shape'] == 'sphere'
    size = np.array([body['size'] for body in scene['bodies']])
    half = size if ball else 0.5 * size
    low = p[:, 2] - (half[:, 0] if ball else (np.abs(R[:, 2]) * half).sum(axis=1))
    found = max(0.0, -float(low.min()))
    radius = np.linalg.norm(half, axis=1).max()
    a, b = cKDTree(p).query_pairs(2 * radius, output_type='ndarray').T
    if len(a) == 0:
        return found
    overlap = (half[a, 0] + half[b, 0] - np.linalg.norm(p[b] - p[a], axis=1) if ball
               else _boxes(p, R, half, a, b))
    return max(found, float(overlap.max()))


def _heap(scene: dict[str, Any], looks: np.ndarray) -> dict[str, float]:
    depths = [deepest(scene, look) for look in looks[STRIDE::STRIDE]]
    return {'deepest [mm]': 1e3 * max(depths), 'at the end [mm]': 1e3 * deepest(scene, looks[-1])}


def _stack(scene: dict[str, Any], looks: np.ndarray) -> dict[str, float]:
    moved = looks[:, :, :3] - looks[0, :, :3]
    top = moved[-1, -1]
    depths = [deepest(scene, look) for look in looks[STRIDE::STRIDE]]
    return {'sag of the top [mm]': -1e3 * top[2],
            'drift of the top [mm]': 1e3 * math.hypot(*top[:2]), 'deepest [mm]': 1e3 * max(depths)}


def _pyramid(scene: dict[str, Any], looks: np.ndarray) -> dict[str, float]:
    moved = np.linalg.norm(looks[-1, :, :3] - looks[0, :, :3], axis=1)
    return {'largest displacement [mm]': 1e3 * float(moved.max())} | _heap(scene, looks)


def _bounce(scene: dict[str, Any], looks: np.ndarray) -> dict[str, float]:
    z = looks[:, 0, 2] - scene['bodies'][0]['size'][0]
    apexes = z[1:-1][(z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:]) & (z[1:-1] > 1e-2)][:3]
    if len(apexes) < 3:
        return {'apex error [%]': math.inf}
    exact = scene['restitution'] ** (2 * np.arange(1, 4))
    return {'apex error [%]': 100 * float(np.abs(apexes / exact - 1.0).max())}


def _creep(scene: dict[str, Any], looks: np.ndarray) -> dict[str, float]:
    return {'creep [m]': float(abs(looks[-1, 0, 0] - looks[0, 0, 0]))}


def _distance(share: float) -> Callable[[dict[str, Any], np.ndarray], dict[str, float]]:
    """Return the figure of a body that accelerates down the slope with a share of g."""
    def figure(scene: dict[str, Any], looks: np.ndarray) -> dict[str, float]:
        exact = 0.5 * share * G * (scene['step'] * scene['steps']) ** 2
        return {'distance error': abs(float(looks[-1, 0, 0]) / exact - 1.0)}
    return figure


def _torque_free(scene: dict[str, Any], looks: np.ndarray) -> dict[str, float]:
    moments = np.array(scene['bodies'][0]['moments'])
    in_body = np.einsum('nji,nj->ni', rotations(looks[:, 0, 3:7]), looks[:, 0, 10:])
    energy = 0.5 * (moments * in_body ** 2).sum(axis=1)
    q, r = looks[-1, 0, 3:7] / np.linalg.norm(looks[-1, 0, 3:7]), AFTER_100_S
    apart = r[3] * q[:3] - q[3] * r[:3] - np.cross(r[:3], q[:3])
    return {'attitude error [rad]': 2.0 * math.asin(min(1.0, float(np.linalg.norm(apart)))),
            'energy drift': float(np.abs(energy / energy[0] - 1.0).max())}


_FIGURES: dict[str, Callable[[dict[str, Any], np.ndarray], dict[str, float]]] = {
    'free 1000': lambda scene, looks: {}, 'spheres 666': _heap, 'pile 1000': _heap,
    'stack 10': _stack, 'stack 20': _stack, 'pyramid 210': _pyramid, 'bounce': _bounce,
    'slope holds': _creep, 'torque-free': _torque_free,
    'slope slides': _distance(math.sin(SLOPE) - 0.2 * math.cos(SLOPE)),
    'roll': _distance(5.0 / 7.0 * math.sin(SLOPE))}


def figures(scene: dict[str, Any], looks: np.ndarray,
            ground: float | None) -> dict[str, float]:
    """
    Return the figures of one run by their names.

    `looks` are (looks, bodies, 13) as runner.py writes them, `ground` is the force [N] of the
    ground in the last step.
    """
    found = _FIGURES[scene['name']](scene, looks)
    if ground is not None and scene['name'].startswith('stack'):
        weight = G * sum(body['mass'] for body in scene['bodies'])
        found['force error'] = abs(ground / weight - 1.0)
    return found
