//! Queries (rays, fans and packets of rays, lists of directions) and results (hits).
//!
//! Plain data in world coordinates, independent of scenes and trees.
//! May use: `simd`, for the layout of its vectors.

mod directions;
mod packet;
#[allow(clippy::module_inception, reason = "the ray itself")]
mod ray;

pub use directions::Directions;
pub(crate) use packet::TOGETHER;
pub use packet::{PACKET, Packet, PacketHits};
pub use ray::{Fan, Hit, Ray, Recent};
