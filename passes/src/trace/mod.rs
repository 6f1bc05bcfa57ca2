//! The interface between effects and tracers, and the tracers of the processor: effects see rays, hits and [`Tracer`], and nothing of the
//! acceleration structure.
//!
//! * [`Bvh`] is the fast one: watertight (Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1),
//!   2013), with conservative box tests.
//! * [`BruteForce`] is the reference that tests compare with.
//! * [`Double`] gives the same answers as [`BruteForce`], fast enough for reference pictures.
//! * [`WithSpheres`] puts exact spheres ([`SphereTree`]) beside the triangles of another tracer.
//! * [`Recorder`] keeps every ray of a pixel, for people to read.
//! * [`DynTracer`] is any tracer behind a pointer.
//! * [`SurfacePoint`] starts secondary rays so that they do not hit the surface they leave.
//!
//! The folders are floors: each uses those below it, never one above it, and the test `layout` fails where that is broken.
//!
//! | floor | what it holds |
//! |---|---|
//! | `bvh`, `reference`, `recorder`, `with_spheres`, `erased` | the tracers |
//! | `tracer`, `segments` | the traits that effects and devices meet at |
//! | `parallel` | rays of one direction |
//! | `packet`, `fan` | rays that start or run side by side |
//! | `single`, `build`, `origin`, `spheres` | one ray; how the tree is made; where rays start; exact spheres |
//! | `tree` | the tree in memory |
//! | `ray` | questions and answers |
//! | `rounding` | every error bound |
//! | `simd` | vectors |

mod build;
mod bvh;
mod erased;
mod fan;
mod origin;
mod packet;
mod parallel;
mod ray;
mod recorder;
mod reference;
mod rounding;
mod segments;
mod simd;
mod single;
mod spheres;
mod tracer;
mod tree;
mod with_spheres;

pub use build::{Quality, gpu_binary, gpu_tree};
pub use bvh::Bvh;
pub use erased::DynTracer;
pub(crate) use erased::Erased;
pub use fan::{Candidates, Neighbourhood};
pub use origin::SurfacePoint;
pub(crate) use origin::{SurfacePoints, at_vertices, half_of, vertices};
pub(crate) use parallel::Faces;
pub use parallel::{Decided, Estimates};
pub use ray::{Directions, Fan, Hit, PACKET, Packet, PacketHits, Ray, Recent};
pub use recorder::{Event, Outcome, RecordedRay, Recorder};
pub use reference::{BruteForce, Double, DoubleHit, DoubleRay};
pub use segments::{Segment, SegmentTracer, Segments};
pub use simd::InstructionSet;
pub(crate) use simd::{Detected, F16, Kernel, LANES, Mask, Simd, WIDE, higher, lower, vector_at};
#[cfg(test)]
pub(crate) use spheres::roots as sphere_roots;
pub use spheres::{BOUNDS as SPHERE_BOUNDS, Content as SphereContent, DEPTH as SPHERE_STACK, SphereTree};
pub use tracer::{Announcement, Purpose, Tracer};
pub(crate) use tree::Bounds;
pub use with_spheres::WithSpheres;
