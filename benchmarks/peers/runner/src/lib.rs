// Copyright 2026 The rigid_sim_ros authors
// SPDX-License-Identifier: Apache-2.0

//! What runners in Rust share: runner.py says what a runner does.

use serde::Deserialize;
use std::{env, fs, time::Instant};

#[derive(Deserialize)]
pub struct Scene {
    pub name: String,
    pub step: f64,
    pub steps: usize,
    pub every: usize,
    pub gravity: [f64; 3],
    pub ground: bool,
    pub friction: f64,
    pub restitution: f64,
    pub bodies: Vec<Body>,
}

#[derive(Deserialize)]
pub struct Body {
    pub shape: String,
    pub size: Vec<f64>,
    pub mass: f64,
    pub moments: [f64; 3],
    pub position: [f64; 3],
    pub orientation: [f64; 4],
    pub linear: [f64; 3],
    pub angular: [f64; 3],
}

/// Position, orientation x, y, z, w, linear and angular velocity of a body.
pub type Motion = [f64; 13];

/// A scene in an engine.
pub trait World {
    fn build(scene: &Scene) -> Self;
    fn step(&mut self);
    fn motion(&self, body: usize) -> Motion;
    /// The mean vertical force of the ground in the last step [N], if the engine says it.
    fn ground_force(&self) -> Option<f64>;
}

/// Runs the scene that the command line names.
pub fn run<W: World>() {
    let arguments: Vec<String> = env::args().collect();
    let (source, target) = (&arguments[1], &arguments[2]);
    let limit: f64 = arguments[3].parse().expect("a limit in seconds");
    let text = fs::read_to_string(source).expect("a scene");
    let scene: Scene = serde_json::from_str(&text).expect("a scene in JSON");

    let mut world = W::build(&scene);
    let mut output: Vec<u8> = Vec::new();
    let mut look = |world: &W| {
        let numbers = (0..scene.bodies.len()).flat_map(|body| world.motion(body));
        output.extend(numbers.flat_map(f64::to_le_bytes));
    };
    look(&world);
    let (mut seconds, mut done) = (0.0, 0);
    while done < scene.steps && seconds < limit {
        let count = scene.every.min(scene.steps - done);
        let start = Instant::now();
        for _ in 0..count {
            world.step();
        }
        seconds += start.elapsed().as_secs_f64();
        done += count;
        look(&world);
    }
    fs::write(target, output).expect("room for the output");
    let force = world.ground_force();
    let report = serde_json::json!({"steps": done, "seconds": seconds, "ground": force});
    println!("{report}");
}
