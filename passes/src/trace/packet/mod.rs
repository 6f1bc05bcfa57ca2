//! Packets of up to sixteen rays that run side by side, and groups of such packets.
//!
//! Box tests against the interval of all rays (`interval`), triangle tests of sixteen rays at a time (`triangle_test`), and a test
//! of the plane alone that decides most shadow rays (`plane_test`). Answers have the bits that they have ray by ray.
//! May use: `single`, `tree`, `ray`, `rounding`, `simd`.

mod group;
mod interval;
mod octant;
mod plane_test;
mod prepared_packet;
mod traverse;
mod triangle_test;

pub(crate) use group::{closest_packets, occluded_packets};
pub(crate) use octant::{Octant, Octants};
pub(crate) use prepared_packet::PreparedPacket;
pub(crate) use traverse::Descent;
