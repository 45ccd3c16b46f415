// Copyright 2026 The rigid_sim_ros authors
// SPDX-License-Identifier: Apache-2.0

//! Runs a scene in Rapier (float64, one thread, settings as they come): the protocol of runner.py.

use rapier3d_f64::prelude::*;
use serde::Deserialize;
use std::{env, fs, time::Instant};

#[derive(Deserialize)]
struct Scene {
    name: String,
    step: f64,
    steps: usize,
    every: usize,
    gravity: [f64; 3],
    ground: bool,
    friction: f64,
    restitution: f64,
    bodies: Vec<Body>,
}

#[derive(Deserialize)]
struct Body {
    shape: String,
    size: Vec<f64>,
    mass: f64,
    moments: [f64; 3],
    position: [f64; 3],
    orientation: [f64; 4],
    linear: [f64; 3],
    angular: [f64; 3],
}

fn vector(v: &[f64; 3]) -> Vector {
    Vector::new(v[0], v[1], v[2])
}

fn insert(world: &mut PhysicsWorld, scene: &Scene, body: &Body) -> RigidBodyHandle {
    let q = &body.orientation;
    let mut pose = Pose::IDENTITY;
    pose.translation = vector(&body.position);
    pose.rotation = Rotation::from_xyzw(q[0], q[1], q[2], q[3]);
    let mass = MassProperties::new(Vector::ZERO, body.mass, vector(&body.moments));
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
    let shape = if body.shape == "sphere" {
        ColliderBuilder::ball(body.size[0])
    } else {
        ColliderBuilder::cuboid(body.size[0] / 2.0, body.size[1] / 2.0, body.size[2] / 2.0)
    };
    let shape = shape.density(0.0).friction(scene.friction).restitution(scene.restitution);
    world.insert(rigid, shape).0
}

fn look(world: &PhysicsWorld, handles: &[RigidBodyHandle], output: &mut Vec<u8>) {
    for handle in handles {
        let body = &world.bodies[*handle];
        let (p, q) = (body.position().translation, body.position().rotation);
        let (v, w) = (body.linvel(), body.angvel());
        for number in [
            p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z,
        ] {
            output.extend_from_slice(&number.to_le_bytes());
        }
    }
}

/// The normal impulses between the ground and the rest in the last step [N s].
fn ground_impulse(world: &PhysicsWorld, ground: ColliderHandle) -> f64 {
    let pairs = world.narrow_phase.contact_pairs();
    pairs
        .filter(|pair| pair.collider1 == ground || pair.collider2 == ground)
        .flat_map(|pair| pair.manifolds())
        .flat_map(|manifold| manifold.points.iter())
        .map(|point| point.data.impulse)
        .sum()
}

fn main() {
    let arguments: Vec<String> = env::args().collect();
    let (source, target) = (&arguments[1], &arguments[2]);
    let limit: f64 = arguments[3].parse().expect("a limit in seconds");
    let text = fs::read_to_string(source).expect("a scene");
    let scene: Scene = serde_json::from_str(&text).expect("a scene in JSON");

    let mut world = PhysicsWorld::new();
    world.gravity = vector(&scene.gravity);
    world.integration_parameters.dt = scene.step;
    let ground = scene.ground.then(|| {
        let plane = SharedShape::halfspace(Vector::new(0.0, 0.0, 1.0));
        let surface = ColliderBuilder::new(plane)
            .friction(scene.friction)
            .restitution(scene.restitution);
        world.insert(RigidBodyBuilder::fixed(), surface).1
    });
    let handles: Vec<RigidBodyHandle> =
        scene.bodies.iter().map(|body| insert(&mut world, &scene, body)).collect();

    let mut output = Vec::new();
    look(&world, &handles, &mut output);
    let (mut seconds, mut done) = (0.0, 0);
    while done < scene.steps && seconds < limit {
        let count = scene.every.min(scene.steps - done);
        let start = Instant::now();
        for _ in 0..count {
            world.step();
        }
        seconds += start.elapsed().as_secs_f64();
        done += count;
        look(&world, &handles, &mut output);
    }
    fs::write(target, output).expect("room for the output");
    let force = ground.map(|handle| ground_impulse(&world, handle) / scene.step);
    let report = serde_json::json!({"steps": done, "seconds": seconds, "ground": force});
    println!("{report}");
}
