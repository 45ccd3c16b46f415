// Copyright 2026 The rigid_sim_ros authors
// SPDX-License-Identifier: Apache-2.0

//! Runs a scene in Rapier (one thread, settings as they come). The feature f64 or f32 says with
//! which numbers it computes; a scene, and what is written, are f64 either way.

#[cfg(feature = "f32")]
use rapier3d::prelude::*;
#[cfg(feature = "f64")]
use rapier3d_f64::prelude::*;
use runner::{Body, Motion, Scene};

struct World {
    world: PhysicsWorld,
    ground: Option<ColliderHandle>,
    bodies: Vec<RigidBodyHandle>,
    step: f64,
}

fn vector(v: &[f64; 3]) -> Vector {
    Vector::new(v[0] as Real, v[1] as Real, v[2] as Real)
}

fn insert(world: &mut PhysicsWorld, scene: &Scene, body: &Body) -> RigidBodyHandle {
    let q = body.orientation.map(|number| number as Real);
    let mut pose = Pose::IDENTITY;
    pose.translation = vector(&body.position);
    pose.rotation = Rotation::from_xyzw(q[0], q[1], q[2], q[3]);
    let mass = MassProperties::new(Vector::ZERO, body.mass as Real, vector(&body.moments));
    let rigid = RigidBodyBuilder::dynamic()
        .pose(pose)
        .linvel(vector(&body.linear))
        .angvel(vector(&body.angular))
        .linear_damping(0.0)
        .angular_damping(0.0)
        .can_sleep(false)
        // Its guard against fast rotation would spoil the body that flips.
        .allow_fast_rotation(scene.name == "torque-free")
        .additional_mass_properties(mass);
    let size: Vec<Real> = body.size.iter().map(|&number| number as Real).collect();
    let shape = if body.shape == "sphere" {
        ColliderBuilder::ball(size[0])
    } else {
        ColliderBuilder::cuboid(size[0] / 2.0, size[1] / 2.0, size[2] / 2.0)
    };
    world.insert(rigid, surface(shape.density(0.0), scene)).0
}

fn surface(shape: ColliderBuilder, scene: &Scene) -> ColliderBuilder {
    shape
        .friction(scene.friction as Real)
        .restitution(scene.restitution as Real)
}

impl runner::World for World {
    fn build(scene: &Scene) -> World {
        let mut world = PhysicsWorld::new();
        world.gravity = vector(&scene.gravity);
        world.integration_parameters.dt = scene.step as Real;
        let ground = scene.ground.then(|| {
            let plane = ColliderBuilder::new(SharedShape::halfspace(Vector::new(0.0, 0.0, 1.0)));
            world
                .insert(RigidBodyBuilder::fixed(), surface(plane, scene))
                .1
        });
        let bodies = scene
            .bodies
            .iter()
            .map(|body| insert(&mut world, scene, body))
            .collect();
        World {
            world,
            ground,
            bodies,
            step: scene.step,
        }
    }

    fn step(&mut self) {
        self.world.step();
    }

    fn motion(&self, body: usize) -> Motion {
        let body = &self.world.bodies[self.bodies[body]];
        let (p, q) = (body.position().translation, body.position().rotation);
        let (v, w) = (body.linvel(), body.angvel());
        [
            p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z,
        ]
        .map(f64::from)
    }

    fn ground_force(&self) -> Option<f64> {
        let ground = self.ground?;
        let pairs = self.world.narrow_phase.contact_pairs();
        let impulse: f64 = pairs
            .filter(|pair| pair.collider1 == ground || pair.collider2 == ground)
            .flat_map(|pair| pair.manifolds())
            .flat_map(|manifold| manifold.points.iter())
            .map(|point| f64::from(point.data.impulse))
            .sum();
        Some(impulse / self.step)
    }
}

fn main() {
    runner::run::<World>();
}
