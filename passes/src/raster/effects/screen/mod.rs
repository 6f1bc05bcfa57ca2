//! What rays from glass meet among the surfaces that a picture shows: a march through its G-buffer.
//!
//! A ray in the scene is a straight line on the screen, along which [`nearness`](camera::ScreenCamera) changes evenly: the inverse of the
//! depth in perspective (McGuire and Mara, "Efficient GPU Screen-Space Ray Tracing", JCGT 3 (4), 2014). [`march`] follows that line from
//! pixel to pixel, and skips blocks of pixels that lie behind it as a whole, which a pyramid of nearest surfaces tells ([`pyramid`];
//! Uludag, "Hi-Z Screen-Space Cone-Traced Reflections", GPU Pro 5, 2014). A pixel shows a piece of the plane through its position that
//! its shading normal tells, so that a surface seen at a slant has no steps between pixels.
//!
//! # What is an answer
//! A ray is answered where it meets the seen side of a surface, from in front of it or at most `thickness` and a quarter of a pixel
//! behind it, and where it leaves for the distance in a pixel that shows nothing. It is not answered where it leaves the screen or comes to the camera, meets a surface from
//! behind, meets glass, or is behind a surface, deeper than that: what it meets there is not seen. Letting such rays on adds answers of which most are
//! wrong.

pub mod camera;
pub mod march;
pub mod pyramid;

#[cfg(test)]
mod tests;
