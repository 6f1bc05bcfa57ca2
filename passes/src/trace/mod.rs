//! The interface between effects and tracers, and the tracers of the processor: effects see rays, hits and [`Tracer`], and nothing of the
//! acceleration structure.
//!
//! * [`Bvh`] is the fast one: watertight (Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1),
//!   2013), with conservative box tests.
//! * [`BruteForce`] is the reference that tests compare with.
//! * [`Double`] gives the same results as [`BruteForce`], fast enough for reference pictures.
//! * [`WithSpheres`] adds exact spheres ([`SphereTree`]) to the triangles of another tracer.
//! * [`Recorder`] keeps every ray of a pixel, for people to read.
//! * [`DynTracer`] is any tracer behind a trait object.
//! * [`SurfacePoint`] starts secondary rays so that they do not hit the surface that they leave.
//!
//! The modules form layers: each uses modules of lower layers only, which the test `layout` checks. The uppermost layer comes first:
//!
//! | layer | what it holds |
//! |---|---|
//! | `bvh`, `reference`, `recorder`, `with_spheres`, `erased` | the tracers |
//! | `tracer`, `segments` | the traits through which effects and devices query tracers |
//! | `parallel` | rays of one direction |
//! | `packet`, `fan` | packets of similar rays; fans of rays from one origin |
//! | `single`, `build`, `origin`, `spheres` | one ray; how the tree is built; where rays start; exact spheres |
//! | `tree` | the tree in memory |
//! | `ray` | rays and hits |
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
