//! Benchmarks: what each effect costs per frame, and what error it has against which reference.

pub mod model;
