# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run a scene in Drake: discrete, SAP, point contact, the other settings as they come."""

from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import AddContactMaterial, Box, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation)
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from runner import main, Running


def _properties(scene: dict[str, Any]) -> ProximityProperties:
    properties = ProximityProperties()
    friction = CoulombFriction(scene['friction'], scene['friction'])
    AddContactMaterial(friction=friction, properties=properties)
    return properties


def build(scene: dict[str, Any]) -> Running:
    """Return the scene; Drake has no restitution in discrete time."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, scene['step'])
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    plant.mutable_gravity_field().set_gravity_vector(scene['gravity'])
    if scene['ground']:
        plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), HalfSpace(),
                                        'ground', _properties(scene))
    links = []
    for i, body in enumerate(scene['bodies']):
        moments = np.array(body['moments']) / body['mass']
        link = plant.AddRigidBody(f'b{i}', SpatialInertia(body['mass'], np.zeros(3),
                                                          UnitInertia(*moments)))
        if scene['ground']:
            shape = Sphere(body['size'][0]) if body['shape'] == 'sphere' else Box(*body['size'])
            plant.RegisterCollisionGeometry(link, RigidTransform(), shape, 'shape',
                                            _properties(scene))
        links.append(link)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for link, body in zip(links, scene['bodies'], strict=True):
        x, y, z, w = np.array(body['orientation']) / np.linalg.norm(body['orientation'])
        plant.SetFreeBodyPose(context, link, RigidTransform(Quaternion(w, x, y, z),
                                                            body['position']))
        plant.SetFreeBodySpatialVelocity(
            body=link, V_JpJc=SpatialVelocity(w=body['angular'], v=body['linear']),
            context=context)
    simulator.Initialize()
    done = 0

    def advance(count: int) -> None:
        nonlocal done
        done += count
        simulator.AdvanceTo(done * scene['step'])

    def motion() -> np.ndarray:
        rows = []
        for link in links:
            pose = plant.GetFreeBodyPose(context, link)
            velocity = plant.EvalBodySpatialVelocityInWorld(context, link)
            w, x, y, z = pose.rotation().ToQuaternion().wxyz()
            rows.append([*pose.translation(), x, y, z, w, *velocity.translational(),
                         *velocity.rotational()])
        return np.array(rows)

    def ground_force() -> float | None:
        if not scene['ground']:
            return None
        contacts = plant.get_contact_results_output_port().Eval(context)
        infos = [contacts.point_pair_contact_info(k)
                 for k in range(contacts.num_point_pair_contacts())]
        world = plant.world_body().index()
        # The force on B; on the bodies, whichever of the two the ground is.
        return float(sum(info.contact_force()[2] * (1.0 if info.bodyA_index() == world else -1.0)
                         for info in infos if world in (info.bodyA_index(), info.bodyB_index())))

    return Running(advance, motion, ground_force)


if __name__ == '__main__':
    main(build)
