//! Packets of up to sixteen similar rays, and groups of such packets.
//!
//! Slab tests use the interval of all rays (`interval`), triangle tests take sixteen rays at a time (`triangle_test`), and a test of the
//! plane alone decides most shadow rays (`plane_test`). The results are bit for bit those of single rays.
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
