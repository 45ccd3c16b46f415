// Copyright 2026 The rigid_sim_ros authors
// SPDX-License-Identifier: Apache-2.0

//! Runs a scene in Jolt (float32, one thread, settings as they come).
//!
//! Its C interface has gravity along -y and no other, so what is x, y, z in a scene is x, z, -y
//! here, of boxes too. Where gravity leans or is absent, Jolt's does not act on the bodies, and a
//! force does in each step. The interface takes mass and moments from a shape and its density: of
//! a solid ball or box they are those of the scene, and the one body that is not solid, which
//! touches nothing, gets the box that has its moments. A ground is a wide box.

use joltc_sys::*;
use runner::{Body, Motion, Scene};
use std::{ffi::c_uint, ffi::c_void, ptr};

// Jolt is written in C++; its bindings do not say so to the linker.
#[link(name = "stdc++")]
extern "C" {}

const FIXED: JPC_ObjectLayer = 0;
const MOVING: JPC_ObjectLayer = 1;
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];
const GROUND: (f64, f64) = (100.0, 2.0); // half its width, its thickness [m]

unsafe extern "C" fn broad_layers(_: *const c_void) -> c_uint {
    2
}

unsafe extern "C" fn broad_layer(_: *const c_void, layer: JPC_ObjectLayer) -> JPC_BroadPhaseLayer {
    layer as JPC_BroadPhaseLayer
}

unsafe extern "C" fn meets_layer(
    _: *const c_void,
    layer: JPC_ObjectLayer,
    other: JPC_BroadPhaseLayer,
) -> bool {
    layer == MOVING || JPC_ObjectLayer::from(other) == MOVING
}

unsafe extern "C" fn meets(_: *const c_void, a: JPC_ObjectLayer, b: JPC_ObjectLayer) -> bool {
    a == MOVING || b == MOVING
}

fn vector(v: &[f64; 3]) -> JPC_Vec3 {
    let (x, y, z) = (v[0] as f32, v[2] as f32, -v[1] as f32);
    JPC_Vec3 { x, y, z, _w: z }
}

/// Full lengths of a box as Jolt's half ones, along its own axes.
unsafe fn box_shape(size: &[f64], density: f64) -> *mut JPC_Shape {
    let half = [size[0], size[2], size[1]].map(|side| (0.5 * side) as f32);
    let mut settings = JPC_BoxShapeSettings::default();
    settings.HalfExtent = JPC_Vec3 {
        x: half[0],
        y: half[1],
        z: half[2],
        _w: half[2],
    };
    settings.Density = density as f32;
    settings.ConvexRadius = half.into_iter().fold(settings.ConvexRadius, f32::min);
    let (mut shape, mut error) = (ptr::null_mut(), ptr::null_mut());
    assert!(
        JPC_BoxShapeSettings_Create(&settings, &mut shape, &mut error),
        "a box"
    );
    shape
}

unsafe fn ball_shape(radius: f64, density: f64) -> *mut JPC_Shape {
    let mut settings = JPC_SphereShapeSettings::default();
    settings.Radius = radius as f32;
    settings.Density = density as f32;
    let (mut shape, mut error) = (ptr::null_mut(), ptr::null_mut());
    assert!(
        JPC_SphereShapeSettings_Create(&settings, &mut shape, &mut error),
        "a ball"
    );
    shape
}

unsafe fn shape(body: &Body) -> *mut JPC_Shape {
    if body.shape == "sphere" {
        let radius = body.size[0];
        return ball_shape(
            radius,
            body.mass / (4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)),
        );
    }
    // A solid box with moments A, B, C has sides of which the first is sqrt(6 (B + C - A) / m);
    // one without thickness (A + B = C) would have no volume, and gets 1 mm.
    let sum: f64 = body.moments.iter().sum();
    let sides = body
        .moments
        .map(|moment| (6.0 * (sum - 2.0 * moment) / body.mass).sqrt().max(1e-3));
    box_shape(&sides, body.mass / sides.iter().product::<f64>())
}

struct World {
    system: *mut JPC_PhysicsSystem,
    memory: *mut JPC_TempAllocatorImpl,
    jobs: *mut JPC_JobSystemThreadPool,
    interface: *mut JPC_BodyInterface,
    bodies: Vec<JPC_BodyID>,
    forces: Vec<JPC_Vec3>, // in each step, where gravity is not Jolt's
    step: f32,
}

unsafe fn insert(
    interface: *mut JPC_BodyInterface,
    settings: &JPC_BodyCreationSettings,
) -> JPC_BodyID {
    let body = JPC_BodyInterface_CreateBody(interface, settings);
    assert!(!body.is_null(), "room for a body");
    let id = JPC_Body_GetID(body);
    JPC_BodyInterface_AddBody(interface, id, JPC_ACTIVATION_ACTIVATE);
    id
}

/// Jolt takes the root of the product of two coefficients of friction, of restitution the larger.
fn surface(scene: &Scene) -> JPC_BodyCreationSettings {
    JPC_BodyCreationSettings {
        Friction: scene.friction as f32,
        Restitution: scene.restitution as f32,
        ..Default::default()
    }
}

unsafe fn insert_body(interface: *mut JPC_BodyInterface, scene: &Scene, body: &Body) -> JPC_BodyID {
    let q = body.orientation.map(|number| number as f32);
    insert(
        interface,
        &JPC_BodyCreationSettings {
            Position: vector(&body.position),
            Rotation: JPC_Quat {
                x: q[0],
                y: q[2],
                z: -q[1],
                w: q[3],
            },
            LinearVelocity: vector(&body.linear),
            AngularVelocity: vector(&body.angular),
            ObjectLayer: MOVING,
            MotionType: JPC_MOTION_TYPE_DYNAMIC,
            AllowSleeping: false,
            LinearDamping: 0.0,
            AngularDamping: 0.0,
            GravityFactor: if scene.gravity == GRAVITY { 1.0 } else { 0.0 },
            // Without it, as it comes, the body that flips would turn about one axis for ever.
            ApplyGyroscopicForce: scene.name == "torque-free",
            Shape: shape(body),
            ..surface(scene)
        },
    )
}

unsafe fn new_system(count: usize) -> *mut JPC_PhysicsSystem {
    let layers = JPC_BroadPhaseLayerInterfaceFns {
        GetNumBroadPhaseLayers: Some(broad_layers),
        GetBroadPhaseLayer: Some(broad_layer),
    };
    let with_layers = JPC_ObjectVsBroadPhaseLayerFilterFns {
        ShouldCollide: Some(meets_layer),
    };
    let pairs = JPC_ObjectLayerPairFilterFns {
        ShouldCollide: Some(meets),
    };
    let system = JPC_PhysicsSystem_new();
    JPC_PhysicsSystem_Init(
        system,
        count as c_uint + 1,
        0,
        65536,
        65536,
        JPC_BroadPhaseLayerInterface_new(ptr::null(), layers),
        JPC_ObjectVsBroadPhaseLayerFilter_new(ptr::null(), with_layers),
        JPC_ObjectLayerPairFilter_new(ptr::null(), pairs),
    );
    system
}

impl runner::World for World {
    fn build(scene: &Scene) -> World {
        // SAFETY: the calls that Jolt's interface wants, in their order; all lives until the end.
        unsafe {
            JPC_RegisterDefaultAllocator();
            JPC_FactoryInit();
            JPC_RegisterTypes();
            let system = new_system(scene.bodies.len());
            let interface = JPC_PhysicsSystem_GetBodyInterface(system);
            if scene.ground {
                let (half, deep) = GROUND;
                insert(
                    interface,
                    &JPC_BodyCreationSettings {
                        Position: vector(&[0.0, 0.0, -0.5 * deep]),
                        ObjectLayer: FIXED,
                        MotionType: JPC_MOTION_TYPE_STATIC,
                        Shape: box_shape(&[2.0 * half, 2.0 * half, deep], 1.0),
                        ..surface(scene)
                    },
                );
            }
            let bodies = scene
                .bodies
                .iter()
                .map(|body| insert_body(interface, scene, body))
                .collect();
            let leans = scene.gravity != GRAVITY && scene.gravity != [0.0; 3];
            let pushed = if leans { &scene.bodies[..] } else { &[] };
            let forces = pushed
                .iter()
                .map(|body| vector(&scene.gravity.map(|g| g * body.mass)));
            JPC_PhysicsSystem_OptimizeBroadPhase(system);
            World {
                system,
                memory: JPC_TempAllocatorImpl_new(256 << 20),
                jobs: JPC_JobSystemThreadPool_new3(
                    JPC_MAX_PHYSICS_JOBS as c_uint,
                    JPC_MAX_PHYSICS_BARRIERS as c_uint,
                    0,
                ),
                interface,
                bodies,
                forces: forces.collect(),
                step: scene.step as f32,
            }
        }
    }

    fn step(&mut self) {
        // SAFETY: what `build` made.
        unsafe {
            for (id, force) in self.bodies.iter().zip(&self.forces) {
                JPC_BodyInterface_AddForce(self.interface, *id, *force);
            }
            JPC_PhysicsSystem_Update(self.system, self.step, 1, self.memory, self.jobs);
        }
    }

    fn motion(&self, body: usize) -> Motion {
        // SAFETY: the body is in the system, and each call gets places of the types it fills.
        unsafe {
            let id = self.bodies[body];
            let p = JPC_BodyInterface_GetCenterOfMassPosition(self.interface, id);
            let q = JPC_BodyInterface_GetRotation(self.interface, id);
            let v = JPC_BodyInterface_GetLinearVelocity(self.interface, id);
            let w = JPC_BodyInterface_GetAngularVelocity(self.interface, id);
            [
                p.x, -p.z, p.y, q.x, -q.z, q.y, q.w, v.x, -v.z, v.y, w.x, -w.z, w.y,
            ]
            .map(f64::from)
        }
    }

    fn ground_force(&self) -> Option<f64> {
        None
    }
}

fn main() {
    runner::run::<World>();
}
