//! Embree's structures, as the headers of versions 3 and 4 define them.

use curitiba::passes::trace::{PACKET, Packet};
use std::ffi::{c_int, c_void};

pub type Filter = unsafe extern "C" fn(*const FilterArguments);
/// `RTCFilterFunctionNArguments`.
#[repr(C)]
pub struct FilterArguments {
    pub valid: *mut c_int,
    pub geometry_user: *mut c_void,
    pub context: *mut c_void,
    pub ray: *mut f32,
    pub hit: *mut f32,
    pub count: u32,
}

/// `RTCIntersectContext` of version 3; its last fields are `RTCRayQueryContext` of version 4. After them follows the
/// asker for hits on transparent triangles. Both versions pass the context's address to filters.
#[repr(C)]
pub struct Context {
    /// In version 3 only.
    pub flags: c_int,
    pub filter: Option<Filter>,
    /// Version 3: the instance. Version 4 gets the address of this field as its context.
    pub instance: [u32; 2],
    pub asker: *const Asker,
}

/// The question that a filter asks. The closure gets the lane, geometry, primitive, and t, u, v.
pub struct Asker {
    pub closure: *mut c_void,
    pub call: unsafe fn(*mut c_void, usize, u32, u32, [f32; 3]) -> bool,
}

/// `RTCIntersectArguments` and `RTCOccludedArguments` of version 4.
#[repr(C)]
pub struct Arguments {
    pub flags: c_int,
    pub features: u32,
    pub context: *mut c_void,
    pub filter: Option<Filter>,
    pub intersect: *const c_void,
    pub spare: [u64; 2],
}

/// `RTCRayHit` and `RTCRayHit16`; version 3 lacks the last field. An occlusion query reads the first twelve rows.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct RayHit<const N: usize> {
    pub origin: [[f32; N]; 3],
    pub near: [f32; N],
    pub direction: [[f32; N]; 3],
    pub time: [f32; N],
    pub far: [f32; N],
    pub mask: [u32; N],
    pub id: [u32; N],
    pub flags: [u32; N],
    pub normal: [[f32; N]; 3],
    pub u: [f32; N],
    pub v: [f32; N],
    pub primitive: [u32; N],
    pub geometry: [u32; N],
    pub instance: [[u32; N]; 2],
}

/// `RTCRayNp`.
#[repr(C)]
pub struct StreamRays(pub [*mut c_void; 12]);

/// `RTCRayHitNp`.
#[repr(C)]
pub struct Stream {
    pub rays: StreamRays,
    pub hits: [*mut c_void; 8],
}

pub const INVALID: u32 = u32::MAX;

impl<const N: usize> RayHit<N> {
    pub const EMPTY: Self = Self {
        origin: [[0.0; N]; 3],
        near: [0.0; N],
        direction: [[0.0; N]; 3],
        time: [0.0; N],
        far: [0.0; N],
        mask: [u32::MAX; N],
        id: [0; N],
        flags: [0; N],
        normal: [[0.0; N]; 3],
        u: [0.0; N],
        v: [0.0; N],
        primitive: [INVALID; N],
        geometry: [INVALID; N],
        instance: [[INVALID; N]; 2],
    };
}

/// The rows of a stream: twelve of `RTCRayNp` and eight of `RTCHitNp`; integers are stored as their bits.
pub struct StreamBuffer {
    pub rows: [Vec<f32>; 20],
    /// By ray: 16 times the packet plus the lane.
    pub origin_of: Vec<u32>,
}

impl StreamBuffer {
    /// A buffer for up to this number of packets.
    pub fn new(packets: usize) -> Self {
        let rows = std::array::from_fn(|_| vec![0.0; packets * PACKET]);
        Self { rows, origin_of: vec![0; packets * PACKET] }
    }

    pub fn fill(&mut self, packets: &[Packet]) -> usize {
        let mut count = 0;
        for (index, packet) in packets.iter().enumerate() {
            if packet.active == u16::MAX {
                let range = count..count + PACKET;
                for axis in 0..3 {
                    self.rows[axis][range.clone()].copy_from_slice(&packet.origin[axis]);
                    self.rows[4 + axis][range.clone()].copy_from_slice(&packet.direction[axis]);
                }
                self.rows[3][range.clone()].fill(packet.t_min);
                self.rows[8][range].fill(packet.t_max);
                for lane in 0..PACKET {
                    self.origin_of[count + lane] = (index * PACKET + lane) as u32;
                }
                count += PACKET;
                continue;
            }
            for lane in packet.lanes() {
                for axis in 0..3 {
                    self.rows[axis][count] = packet.origin[axis][lane];
                    self.rows[4 + axis][count] = packet.direction[axis][lane];
                }
                self.rows[3][count] = packet.t_min;
                self.rows[8][count] = packet.t_max;
                self.origin_of[count] = (index * PACKET + lane) as u32;
                count += 1;
            }
        }
        let none = f32::from_bits(u32::MAX);
        for row in [9, 17, 18, 19] {
            self.rows[row][..count].fill(none);
        }
        count
    }
}

pub fn one(packet: &Packet, lane: usize) -> RayHit<1> {
    RayHit {
        origin: packet.origin.map(|axis| [axis[lane]]),
        direction: packet.direction.map(|axis| [axis[lane]]),
        near: [packet.t_min],
        far: [packet.t_max],
        ..RayHit::EMPTY
    }
}

pub fn sixteen(packet: &Packet) -> RayHit<PACKET> {
    RayHit {
        origin: packet.origin,
        direction: packet.direction,
        near: [packet.t_min; PACKET],
        far: [packet.t_max; PACKET],
        ..RayHit::EMPTY
    }
}

#[repr(C, align(64))]
pub struct Valid(pub [c_int; PACKET]);

pub fn valid(active: u16) -> Valid {
    Valid(std::array::from_fn(|lane| -c_int::from(active >> lane & 1)))
}
