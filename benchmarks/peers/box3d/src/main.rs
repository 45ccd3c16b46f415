// Copyright 2026 The rigid_sim_ros authors
// SPDX-License-Identifier: Apache-2.0

//! Runs a scene in Box3D (float32, one thread, four substeps, as its manual has them, the other
//! settings as they come). A ground is a wide box.

use box3d_sys::*;
use runner::{Body, Motion, Scene};

const SUBSTEPS: i32 = 4;
const GROUND: (f32, f32) = (100.0, 1.0); // half its width, half its thickness [m]

struct World {
    world: b3WorldId,
    ground: Option<b3BodyId>,
    bodies: Vec<b3BodyId>,
    step: f32,
}

fn vector(v: &[f64; 3]) -> b3Vec3 {
    b3Vec3 {
        x: v[0] as f32,
        y: v[1] as f32,
        z: v[2] as f32,
    }
}

unsafe fn surface(scene: &Scene) -> b3ShapeDef {
    let mut shape = b3DefaultShapeDef();
    shape.baseMaterial.friction = scene.friction as f32;
    shape.baseMaterial.restitution = scene.restitution as f32;
    shape
}

unsafe fn insert_ground(world: b3WorldId, scene: &Scene) -> b3BodyId {
    let (half, deep) = GROUND;
    let mut definition = b3DefaultBodyDef();
    definition.position.z = -deep;
    let body = b3CreateBody(world, &definition);
    b3CreateHullShape(body, &surface(scene), &b3MakeBoxHull(half, half, deep).base);
    body
}

unsafe fn insert(world: b3WorldId, scene: &Scene, body: &Body) -> b3BodyId {
    let q = body.orientation.map(|number| number as f32);
    let mut definition = b3DefaultBodyDef();
    definition.type_ = b3BodyType_b3_dynamicBody;
    definition.position = vector(&body.position);
    definition.rotation = b3Quat {
        v: b3Vec3 {
            x: q[0],
            y: q[1],
            z: q[2],
        },
        s: q[3],
    };
    definition.linearVelocity = vector(&body.linear);
    definition.angularVelocity = vector(&body.angular);
    definition.enableSleep = false;
    // Its limit of rotation would spoil the body that flips.
    definition.allowFastRotation = scene.name == "torque-free";
    let id = b3CreateBody(world, &definition);
    let size: Vec<f32> = body.size.iter().map(|&number| number as f32).collect();
    if body.shape == "sphere" {
        let ball = b3Sphere {
            center: vector(&[0.0; 3]),
            radius: size[0],
        };
        b3CreateSphereShape(id, &surface(scene), &ball);
    } else {
        let hull = b3MakeBoxHull(0.5 * size[0], 0.5 * size[1], 0.5 * size[2]);
        b3CreateHullShape(id, &surface(scene), &hull.base);
    }
    let [a, b, c] = body.moments;
    b3Body_SetMassData(
        id,
        b3MassData {
            mass: body.mass as f32,
            center: vector(&[0.0; 3]),
            inertia: b3Matrix3 {
                cx: vector(&[a, 0.0, 0.0]),
                cy: vector(&[0.0, b, 0.0]),
                cz: vector(&[0.0, 0.0, c]),
            },
        },
    );
    id
}

impl runner::World for World {
    fn build(scene: &Scene) -> World {
        // SAFETY: definitions begin as Box3D's own; the handles live until the end.
        unsafe {
            let mut definition = b3DefaultWorldDef();
            definition.gravity = vector(&scene.gravity);
            definition.enableSleep = false;
            definition.workerCount = 1;
            let world = b3CreateWorld(&definition);
            let ground = scene.ground.then(|| insert_ground(world, scene));
            let bodies = scene
                .bodies
                .iter()
                .map(|body| insert(world, scene, body))
                .collect();
            World {
                world,
                ground,
                bodies,
                step: scene.step as f32,
            }
        }
    }

    fn step(&mut self) {
        // SAFETY: the world that `build` made.
        unsafe { b3World_Step(self.world, self.step, SUBSTEPS) }
    }

    fn motion(&self, body: usize) -> Motion {
        // SAFETY: a body that `build` made.
        unsafe {
            let id = self.bodies[body];
            let (p, q) = (b3Body_GetPosition(id), b3Body_GetRotation(id));
            let (v, w) = (b3Body_GetLinearVelocity(id), b3Body_GetAngularVelocity(id));
            [
                p.x, p.y, p.z, q.v.x, q.v.y, q.v.z, q.s, v.x, v.y, v.z, w.x, w.y, w.z,
            ]
            .map(f64::from)
        }
    }

    fn ground_force(&self) -> Option<f64> {
        let ground = self.ground?;
        // SAFETY: the ground that `build` made, and room for as many contacts as it has; what the
        // contacts point to is read before anything changes.
        unsafe {
            let mut contacts =
                vec![b3ContactData::default(); b3Body_GetContactCapacity(ground) as usize];
            let count = b3Body_GetContactData(ground, contacts.as_mut_ptr(), contacts.len() as i32);
            let mut impulse = 0.0;
            for contact in &contacts[..count as usize] {
                for k in 0..contact.manifoldCount as usize {
                    let manifold = &*contact.manifolds.add(k);
                    let points = &manifold.points[..manifold.pointCount as usize];
                    impulse += points
                        .iter()
                        .map(|p| f64::from(p.normalImpulse))
                        .sum::<f64>();
                }
            }
            // An impulse is that of the last substep.
            Some(impulse * f64::from(SUBSTEPS) / f64::from(self.step))
        }
    }
}

fn main() {
    runner::run::<World>();
}
