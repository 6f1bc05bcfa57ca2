//! What is asked: rays, fans and packets of rays, lists of directions; and what is answered: hits.
//!
//! Plain data in world coordinates, without anything of a scene or of a tree.
//! May use: `simd`, for the layout of its vectors.

mod directions;
mod packet;
#[allow(clippy::module_inception, reason = "the ray itself")]
mod ray;

pub use directions::Directions;
pub(crate) use packet::TOGETHER;
pub use packet::{PACKET, Packet, PacketHits};
pub use ray::{Fan, Hit, Ray, Recent};
