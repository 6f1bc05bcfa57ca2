//! Rays from glass, marched through the G-buffer of a picture to find the surfaces they hit.
//!
//! A ray in the scene is a straight line on the screen, along which [`nearness`](camera::ScreenCamera), in perspective
//! the inverse of the depth, changes linearly (McGuire and Mara, "Efficient GPU Screen-Space Ray Tracing", JCGT 3 (4),
//! 2014). [`march`] follows the line from pixel to pixel. It skips blocks of pixels whose surfaces all lie behind the
//! ray, by a pyramid of the nearest surfaces ([`pyramid`]; Uludag, "Hi-Z Screen-Space Cone-Traced Reflections", GPU Pro
//! 5, 2014). A pixel's surface is approximated by a piece of the plane through its position, perpendicular to its shading normal,
//! so that a surface seen at an angle has no steps between pixels.
//!
//! # Answered rays
//! A ray is answered where it hits the visible side of a surface, from in front of it or at most `thickness` and a
//! quarter of a pixel behind it, and where it leaves for infinity in a pixel that shows nothing. A ray is not answered
//! where it leaves the screen, reaches the camera, hits a surface from behind, hits glass, or passes deeper behind a
//! surface: the picture does not show the hits of such rays. Following these rays further yields more hits, but most of
//! the added hits are wrong.

pub mod camera;
pub mod march;
pub mod pyramid;

#[cfg(test)]
mod tests;
