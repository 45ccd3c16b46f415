# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The laws, each with how its scenes are drawn and judged, and with the models that it binds."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

from laws import (
    apart_laws, bridge_laws, driven_laws, elastic_laws, energy_laws, ground_laws, heap_laws,
    impact_laws, jointed_laws, jointed_twins, mixed_laws, pivot_laws, rest_laws, ridden_laws,
    row_laws, shot_laws, slept_laws, standing_laws, twin_laws)
from laws.crowd_scenes import draw_collapse, draw_crates
from laws.driven_scenes import draw_driven, draw_driven_at_a_wall, draw_driven_floating
from laws.ground_scenes import (
    draw_falling_ball, draw_ground_scene, draw_resting, draw_shots, draw_sliding)
from laws.jointed_scenes import draw_jointed
from laws.mixed_scenes import draw_awake, draw_falling, draw_floating, draw_mixed
from laws.motion import Build, Ours, Run, Verdict
from laws.scenes import Scene, Spec, with_model
from laws.solids import Generator
from laws.thin_scenes import draw_flat, draw_flight, draw_thin, draw_thin_resting
import numpy as np

RIGID = ('timestep', 'event', 'qp')
_TOUCHING = ('timestep', 'event')
# What is soft by its definition is not asked where the law is of rigid impacts and rest.
ALL = (*RIGID, 'penalty')


class Law(NamedTuple):
    """A law of mechanics that is asked of random scenes."""

    name: str
    says: str
    draw: Callable[[Generator], Scene]
    judge: Callable[[Scene, Build], Verdict]
    models: tuple[str, ...] = RIGID


LAWS = {law.name: law for law in (
    Law('energy', 'energy never grows without work',
        energy_laws.draw_energy, energy_laws.judge_energy, RIGID),
    Law('inelastic', 'nothing inelastic separates faster than 2 % of its approach',
        impact_laws.draw_inelastic, impact_laws.judge_inelastic),
    Law('momentum', 'forces between bodies keep P and L',
        energy_laws.draw_momentum, energy_laws.judge_momentum, ALL),
    Law('untouched', 'bodies that never touch are those of a world without the other',
        apart_laws.draw_untouched, apart_laws.judge_untouched, ALL),
    Law('flush', 'a floor of flush pieces is a floor',
        apart_laws.draw_flush, apart_laws.judge_flush),
    Law('symmetric', 'what starts symmetric stays so',
        impact_laws.draw_symmetric, impact_laws.judge_symmetric, ALL),
    Law('turned', 'a turned scene moves alike',
        twin_laws.draw_pair, twin_laws.alike(twin_laws.turned), ALL),
    Law('shifted', 'a shifted scene moves alike',
        twin_laws.draw_pair, twin_laws.alike(twin_laws.shifted), ALL),
    Law('mirrored', 'a mirrored scene moves alike',
        twin_laws.draw_pair, twin_laws.alike(twin_laws.mirrored), ALL),
    Law('scaled', 'a scaled scene moves alike',
        twin_laws.draw_pair, twin_laws.alike(twin_laws.scaled), ALL),
    Law('order', 'order and names of bodies change nothing',
        twin_laws.draw_pair, twin_laws.alike(twin_laws.reordered), ALL),
    Law('weight', 'the force on the ground is the weight at rest',
        rest_laws.draw_weight, rest_laws.judge_weight),
    Law('ridden', 'what stands on a floor that moves goes with it',
        ridden_laws.draw_ridden, ridden_laws.judge_ridden, _TOUCHING),
    Law('rolling', 'rolling keeps energy',
        energy_laws.draw_rolling, energy_laws.judge_rolling),
    Law('limit', 'half the step is half the distance to the limit',
        rest_laws.draw_limit, rest_laws.judge_limit),
    Law('pivot', 'what turns about a border is stopped by the other points of its side',
        pivot_laws.draw_pivot, pivot_laws.judge_pivot, ('timestep',)),
    Law('decided', 'every model agrees on what slides or falls',
        rest_laws.draw_decided, rest_laws.judge_decided))}


_TWINS = (('turned', 'a turned scene moves alike', twin_laws.turned),
          ('shifted', 'a shifted scene moves alike', twin_laws.shifted),
          ('mirrored', 'a mirrored scene moves alike', twin_laws.mirrored),
          ('scaled', 'a scaled scene moves alike', twin_laws.scaled),
          ('order', 'order of bodies and joints changes nothing', twin_laws.reordered))
_JOINTED_TWINS = (
    *_TWINS, ('carried', 'a scene that flies on moves alike', jointed_twins.carried),
    ('split', 'halves that a fixed joint holds are one body', jointed_twins.split))


def _twins(kind: str, draw: Callable[[Generator], Scene], models: tuple[str, ...],
           twins: Sequence[tuple[str, str, Callable[[Generator, Scene], Any]]],
           ) -> tuple[Law, ...]:
    """Return the laws that compare scenes of a kind with their twins."""
    return tuple(Law(f'{kind}-{name}', says, draw, twin_laws.alike(twin), models)
                 for name, says, twin in twins)


# Those of scenes with joints, some of which cannot touch.
_WITH_JOINTS = ('none', 'timestep', 'event')
JOINTED = {law.name: law for law in (
    Law('jointed-energy', 'energy never grows without work, and joints hold',
        draw_jointed, jointed_laws.judge_jointed_energy, _WITH_JOINTS),
    Law('jointed-momentum', 'forces between bodies keep P and L',
        jointed_laws.draw_meeting, jointed_laws.judge_jointed_momentum, _WITH_JOINTS),
    Law('jointed-bridge', 'a heavy body on a nearly taut chain gains no energy, and joints hold',
        bridge_laws.draw_bridge, bridge_laws.judge_bridge, _WITH_JOINTS),
    *_twins('jointed', draw_jointed, _WITH_JOINTS, _JOINTED_TWINS))}

# Those of scenes with joints and loose bodies.
MIXED = {law.name: law for law in (
    Law('mixed-energy', 'energy never grows without work, and joints hold',
        draw_mixed, jointed_laws.judge_jointed_energy, _TOUCHING),
    Law('mixed-momentum', 'forces between bodies keep P and L',
        draw_floating, jointed_laws.judge_jointed_momentum, (*_TOUCHING, 'penalty')),
    Law('mixed-ground', 'the floor feels what changes the momentum, at rest the weight',
        draw_falling, mixed_laws.judge_ground, _TOUCHING),
    Law('mixed-apart', 'what never touches is bit for bit as if it were alone',
        mixed_laws.draw_apart, mixed_laws.judge_apart, ('timestep',)),
    Law('mixed-shots', 'nothing gets through a sheet, however fast, and joints hold',
        shot_laws.draw_shots, shot_laws.judge_shots, _TOUCHING),
    Law('mixed-restored', 'worlds go on from what was saved, bit for bit',
        draw_mixed, mixed_laws.judge_restored, (*_TOUCHING, 'penalty')),
    Law('mixed-asleep', 'what sleeps is held, and wakes when it must',
        mixed_laws.draw_asleep, mixed_laws.judge_asleep, ('timestep',)),
    Law('mixed-standing', 'what stands on joints with dry friction comes to rest',
        standing_laws.draw_standing, standing_laws.judge_standing, _TOUCHING),
    Law('mixed-slept', 'what sleeps is held, and goes on as if it had not slept',
        slept_laws.draw_slept, slept_laws.judge_slept, ('timestep',)),
    Law('mixed-slept-apart', 'what sleeps far away changes nothing, bit for bit',
        slept_laws.draw_slept_apart, mixed_laws.judge_apart, ('timestep',)),
    *_twins('mixed', draw_awake, _TOUCHING, _JOINTED_TWINS))}

# Those of drives that start from rest before walls and loose bodies.
DRIVEN = {law.name: law for law in (
    Law('driven-through', 'what a drive starts from rest passes neither a wall nor a body',
        draw_driven, driven_laws.judge_driven, RIGID),
    Law('driven-energy', 'energy never grows but by the work of drives',
        draw_driven, driven_laws.judge_driven_energy, RIGID),
    Law('driven-momentum', 'drives between bodies keep P and L',
        draw_driven_floating, driven_laws.judge_driven_momentum, ALL),
    Law('driven-inelastic', 'what a drive pushes at an inelastic wall does not come back',
        draw_driven_at_a_wall, driven_laws.judge_driven_at_a_wall, RIGID))}

# Those of crates of one size, and of twenty to sixty bodies: too many for `event` to ask often.
CROWDS = {law.name: law for law in (
    Law('crates-energy', 'energy never grows without work',
        draw_crates, energy_laws.judge_energy, _TOUCHING),
    *_twins('crates', draw_crates, _TOUCHING, _TWINS),
    Law('collapse-energy', 'energy never grows without work where many fall',
        draw_collapse, energy_laws.judge_energy, ('timestep',)),
    Law('heap', 'what falls in a heap overlaps little, gains nothing, and comes to rest',
        heap_laws.draw_heap, heap_laws.judge_heap, _TOUCHING),
    Law('elastic', 'what bounces without loss keeps its energy',
        elastic_laws.draw_elastic, elastic_laws.judge_elastic, _TOUCHING),
    Law('row', 'a blow goes through a row body by body',
        row_laws.draw_row, row_laws.judge_row, _TOUCHING))}

# Those of grounds of triangles.
GROUNDS = {law.name: law for law in (
    Law('ground-energy', 'energy never grows without work',
        draw_ground_scene, energy_laws.judge_energy, _TOUCHING),
    Law('ground-through', 'nothing gets through the ground',
        draw_ground_scene, ground_laws.judge_through, _TOUCHING),
    Law('ground-shots', 'nothing gets through the ground, however fast',
        draw_shots, ground_laws.judge_through, _TOUCHING),
    Law('ground-weight', 'the force on the ground is the weight at rest',
        draw_resting, ground_laws.judge_resting, _TOUCHING),
    Law('ground-plane', 'over a flat ground of triangles all moves as over a plane',
        draw_sliding, apart_laws.judge_flush, _TOUCHING),
    Law('ground-ball', 'a ball that falls on a flat ground of triangles moves as on a plane',
        draw_falling_ball, twin_laws.alike(ground_laws.on_a_plane), ('event',)),
    *_twins('ground', draw_ground_scene, _TOUCHING, _TWINS))}

# Those of what is a thirtieth to a thousandth as thick as it is long.
THIN = {law.name: law for law in (
    Law('thin-energy', 'energy never grows without work',
        partial(energy_laws.draw_energy, draw=draw_thin), energy_laws.judge_energy, _TOUCHING),
    Law('thin-flight', 'energy never grows in free space, however far bodies turn in a step',
        draw_flight, energy_laws.judge_flight, ('timestep',)),
    Law('thin-inelastic', 'nothing inelastic separates faster than 2 % of its approach',
        partial(impact_laws.draw_inelastic, draw=draw_flat), impact_laws.judge_inelastic,
        _TOUCHING),
    Law('thin-momentum', 'forces between bodies keep P and L',
        partial(energy_laws.draw_momentum, draw=draw_thin), energy_laws.judge_momentum, _TOUCHING),
    Law('thin-untouched', 'bodies that never touch are those of a world without the other',
        partial(apart_laws.draw_untouched, draw=draw_thin), apart_laws.judge_untouched, _TOUCHING),
    Law('thin-weight', 'the force on the ground is the weight at rest',
        partial(rest_laws.draw_weight, draw=draw_flat), rest_laws.judge_weight, _TOUCHING),
    Law('thin-rest', 'what falls comes to rest, and weighs what it weighs',
        draw_thin_resting, ground_laws.judge_resting, _TOUCHING),
    Law('thin-through', 'nothing gets through the ground, however fast',
        partial(draw_shots, draw=draw_thin), ground_laws.judge_through, _TOUCHING),
    *_twins('thin', partial(twin_laws.draw_pair, draw=draw_thin), _TOUCHING, _TWINS))}
EVERY_LAW = LAWS | JOINTED | MIXED | DRIVEN | CROWDS | GROUNDS | THIN


def scene(law: str, seed: int) -> Scene:
    """Return the scene of a law and a seed."""
    return EVERY_LAW[law].draw(np.random.default_rng([*law.encode(), seed]))


def builder(model: str, substeps: int = 4) -> Build:
    """Return how a scene gets into this package with a contact model."""
    def build(spec: Spec) -> Run:
        return Ours(with_model(spec, model, substeps))
    return build


def judge(law: str, seed: int, build: Build) -> Verdict:
    """Ask a law of the scene of a seed."""
    found = scene(law, seed)
    try:
        with np.errstate(all='ignore'):
            return EVERY_LAW[law].judge(found, build)
    except ArithmeticError as error:
        return Verdict(np.inf, 0.0, str(error))


def breaches(law: str, model: str, seeds: Iterable[int]) -> dict[int, str]:
    """Return what is broken in the scenes of some seeds, by seed."""
    asked = ((seed, judge(law, seed, builder(model))) for seed in seeds)
    return {seed: f'{found.figure:.3g} > {found.allowed:.3g} {found.what}'
            for seed, found in asked if found.breach}
