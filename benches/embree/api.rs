//! The few functions of Embree 3 and 4 that the bench calls, looked up in a library at run time.
#![allow(unsafe_code, reason = "a C interface")]

use crate::layout::{
    Arguments, Asker, Context, Filter, FilterArguments, INVALID, RayHit, Stream, StreamBuffer, StreamRays, one,
    sixteen, valid,
};
use curitiba::passes::trace::{Hit, PACKET, Packet};
use libloading::Library;
use std::ffi::{CString, c_char, c_int, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::Arc;
use std::sync::atomic::{AtomicIsize, Ordering};

type Handle = *mut c_void;

type Monitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

macro_rules! functions {
    ($($name:ident: $symbol:literal fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        struct Functions { $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)* }

        impl Functions {
            /// # Safety
            /// The library must be Embree 3 or 4, whose functions have these types.
            unsafe fn find(library: &Library) -> Result<Self, libloading::Error> {
                // SAFETY: as the caller promises.
                unsafe { Ok(Self { $($name: *library.get($symbol)?,)* }) }
            }
        }
    };
}

functions! {
    new_device: b"rtcNewDevice" fn(*const c_char) -> Handle;
    release_device: b"rtcReleaseDevice" fn(Handle);
    device_property: b"rtcGetDeviceProperty" fn(Handle, c_int) -> isize;
    device_error: b"rtcGetDeviceError" fn(Handle) -> c_int;
    set_monitor: b"rtcSetDeviceMemoryMonitorFunction" fn(Handle, Option<Monitor>, *mut c_void);
    new_scene: b"rtcNewScene" fn(Handle) -> Handle;
    release_scene: b"rtcReleaseScene" fn(Handle);
    set_scene_flags: b"rtcSetSceneFlags" fn(Handle, c_int);
    set_scene_quality: b"rtcSetSceneBuildQuality" fn(Handle, c_int);
    commit_scene: b"rtcCommitScene" fn(Handle);
    new_geometry: b"rtcNewGeometry" fn(Handle, c_int) -> Handle;
    release_geometry: b"rtcReleaseGeometry" fn(Handle);
    set_geometry_quality: b"rtcSetGeometryBuildQuality" fn(Handle, c_int);
    share_buffer: b"rtcSetSharedGeometryBuffer" fn(Handle, c_int, u32, c_int, *const c_void, usize, usize, usize);
    set_intersect_filter: b"rtcSetGeometryIntersectFilterFunction" fn(Handle, Option<Filter>);
    set_occluded_filter: b"rtcSetGeometryOccludedFilterFunction" fn(Handle, Option<Filter>);
    commit_geometry: b"rtcCommitGeometry" fn(Handle);
    attach_geometry: b"rtcAttachGeometry" fn(Handle, Handle) -> u32;
}

/// The functions that trace: version 3 passes a context before the rays, version 4 arguments after them.
enum Trace {
    Three {
        intersect1: unsafe extern "C" fn(Handle, *mut Context, *mut RayHit<1>),
        occluded1: unsafe extern "C" fn(Handle, *mut Context, *mut RayHit<1>),
        intersect16: unsafe extern "C" fn(*const c_int, Handle, *mut Context, *mut RayHit<PACKET>),
        occluded16: unsafe extern "C" fn(*const c_int, Handle, *mut Context, *mut RayHit<PACKET>),
        intersect_stream: unsafe extern "C" fn(Handle, *mut Context, *const Stream, u32),
        occluded_stream: unsafe extern "C" fn(Handle, *mut Context, *const StreamRays, u32),
    },
    Four {
        intersect1: unsafe extern "C" fn(Handle, *mut RayHit<1>, *mut Arguments),
        occluded1: unsafe extern "C" fn(Handle, *mut RayHit<1>, *mut Arguments),
        intersect16: unsafe extern "C" fn(*const c_int, Handle, *mut RayHit<PACKET>, *mut Arguments),
        occluded16: unsafe extern "C" fn(*const c_int, Handle, *mut RayHit<PACKET>, *mut Arguments),
    },
}

/// A loaded Embree library.
pub struct Embree {
    functions: Functions,
    trace: Trace,
    /// For example `3.13.5`.
    pub version: String,
    /// Never unloaded: with two versions in one process, their threads may still run its code at the end.
    _library: ManuallyDrop<Library>,
}

impl Embree {
    /// Loads the library with this path or soname.
    ///
    /// # Errors
    /// The reason why it cannot be used.
    pub fn load(path: &Path) -> Result<Arc<Self>, String> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let wrong = |error: libloading::Error| format!("{name} cannot be used: {error}");
        // SAFETY: Embree's initialisation has no conditions; the caller states that the file is Embree.
        let library = unsafe { Library::new(path) }.map_err(|_| format!("{name} cannot be loaded"))?;
        // SAFETY: Embree 3 and 4 have these functions with these types.
        let functions = unsafe { Functions::find(&library) }.map_err(wrong)?;
        // SAFETY: a device is made, asked for its version and released. It has one thread, because further threads would never sleep again.
        let [major, minor, patch] = unsafe {
            let device = (functions.new_device)(c"threads=1".as_ptr());
            let version = [1, 2, 3].map(|property| (functions.device_property)(device, property));
            (functions.release_device)(device);
            version
        };
        // SAFETY: the version says which types these functions have.
        let trace = unsafe {
            let find = || {
                Ok(match major {
                    3 => Trace::Three {
                        intersect1: *library.get(b"rtcIntersect1")?,
                        occluded1: *library.get(b"rtcOccluded1")?,
                        intersect16: *library.get(b"rtcIntersect16")?,
                        occluded16: *library.get(b"rtcOccluded16")?,
                        intersect_stream: *library.get(b"rtcIntersectNp")?,
                        occluded_stream: *library.get(b"rtcOccludedNp")?,
                    },
                    _ => Trace::Four {
                        intersect1: *library.get(b"rtcIntersect1")?,
                        occluded1: *library.get(b"rtcOccluded1")?,
                        intersect16: *library.get(b"rtcIntersect16")?,
                        occluded16: *library.get(b"rtcOccluded16")?,
                    },
                })
            };
            find().map_err(wrong)?
        };
        if !(3..=4).contains(&major) {
            return Err(format!("{name} is Embree {major}; the bench knows 3 and 4"));
        }
        Ok(Arc::new(Self {
            functions,
            trace,
            version: format!("{major}.{minor}.{patch}"),
            _library: ManuallyDrop::new(library),
        }))
    }

    /// Whether the version can trace streams of rays.
    pub fn streams(&self) -> bool {
        matches!(self.trace, Trace::Three { .. })
    }
}

/// Options of a build.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Build {
    /// `RTC_BUILD_QUALITY_HIGH` instead of `MEDIUM`.
    pub high: bool,
    /// `RTC_SCENE_FLAG_ROBUST`.
    pub robust: bool,
    /// Number of threads that build.
    pub threads: usize,
}

/// A committed scene of two geometries: opaque triangles, and triangles whose hits are passed to a closure.
pub struct Scene {
    embree: Arc<Embree>,
    device: Handle,
    scene: Handle,
    bytes: Box<AtomicIsize>,
    /// Buffers shared with Embree. `ids` has the triangles' numbers for each geometry.
    _positions: Vec<[f32; 4]>,
    _indices: [Vec<[u32; 3]>; 2],
    ids: [Vec<u32>; 2],
    /// Index in `ids`, for each geometry of Embree.
    groups: Vec<usize>,
}

// SAFETY: a committed scene may be traced from any thread, and is not changed after.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

unsafe extern "C" fn count_bytes(user: *mut c_void, bytes: isize, _: bool) -> bool {
    // SAFETY: `user` is the counter that the device was given, which outlives it.
    unsafe { &*user.cast::<AtomicIsize>() }.fetch_add(bytes, Ordering::Relaxed);
    true
}

impl Scene {
    /// Builds a scene. `indices` and `ids` have the opaque triangles first, and then the transparent ones.
    ///
    /// # Errors
    /// The error that Embree reports.
    pub fn build(
        embree: &Arc<Embree>,
        positions: Vec<[f32; 4]>,
        indices: [Vec<[u32; 3]>; 2],
        ids: [Vec<u32>; 2],
        build: Build,
    ) -> Result<Self, String> {
        let functions = &embree.functions;
        let bytes = Box::new(AtomicIsize::new(0));
        let options = CString::new(format!("threads={}", build.threads)).expect("no NUL");
        let mut groups = Vec::new();
        // SAFETY: handles are used as Embree's manual says; the shared buffers are kept as long as the scene, and their
        // last vertex is 16 bytes long.
        let (device, scene, error) = unsafe {
            let device = (functions.new_device)(options.as_ptr());
            (functions.set_monitor)(device, Some(count_bytes), (&raw const *bytes).cast_mut().cast());
            let scene = (functions.new_scene)(device);
            let quality = if build.high { 2 } else { 1 };
            (functions.set_scene_flags)(scene, if build.robust { 4 } else { 0 });
            (functions.set_scene_quality)(scene, quality);
            for (group, indices) in indices.iter().enumerate().filter(|(_, indices)| !indices.is_empty()) {
                let geometry = (functions.new_geometry)(device, 0);
                (functions.set_geometry_quality)(geometry, quality);
                let (vertices, corners) = (positions.as_ptr().cast(), indices.as_ptr().cast());
                (functions.share_buffer)(geometry, 1, 0, 0x9003, vertices, 0, 16, positions.len());
                (functions.share_buffer)(geometry, 0, 0, 0x5003, corners, 0, 12, indices.len());
                if group == 1 {
                    let filter = if embree.streams() { filter3 } else { filter4 };
                    (functions.set_intersect_filter)(geometry, Some(filter));
                    (functions.set_occluded_filter)(geometry, Some(filter));
                }
                (functions.commit_geometry)(geometry);
                (functions.attach_geometry)(scene, geometry);
                (functions.release_geometry)(geometry);
                groups.push(group);
            }
            (functions.commit_scene)(scene);
            (device, scene, (functions.device_error)(device))
        };
        let built = Self {
            embree: Arc::clone(embree),
            device,
            scene,
            bytes,
            _positions: positions,
            _indices: indices,
            ids,
            groups,
        };
        if error == 0 { Ok(built) } else { Err(format!("Embree {}: error {error} of the build", embree.version)) }
    }

    /// Bytes of memory that Embree holds for the scene.
    pub fn bytes(&self) -> isize {
        self.bytes.load(Ordering::Relaxed)
    }

    fn id(&self, geometry: u32, primitive: u32) -> u32 {
        self.ids[self.groups[geometry as usize]][primitive as usize]
    }

    /// Runs a query; hits on transparent triangles are passed to `accept(lane, hit)`.
    fn with_context<A: FnMut(usize, &Hit) -> bool>(
        &self,
        coherent: bool,
        mut accept: A,
        query: impl FnOnce(*mut Context, *mut Arguments),
    ) {
        let mut closure = |lane: usize, geometry: u32, primitive: u32, [t, u, v]: [f32; 3]| {
            accept(lane, &Hit { t, triangle: self.id(geometry, primitive), u, v })
        };
        fn call_of<F: FnMut(usize, u32, u32, [f32; 3]) -> bool>(
            _: &F,
        ) -> unsafe fn(*mut c_void, usize, u32, u32, [f32; 3]) -> bool {
            |closure, lane, geometry, primitive, tuv| {
                // SAFETY: `closure` is the one that `Asker` was made with, and nothing else uses it during the query.
                unsafe { (*closure.cast::<F>())(lane, geometry, primitive, tuv) }
            }
        }
        let call = call_of(&closure);
        let asker = Asker { closure: (&raw mut closure).cast(), call };
        let mut context =
            Context { flags: c_int::from(coherent), filter: None, instance: [INVALID; 2], asker: &raw const asker };
        let mut arguments = Arguments {
            flags: if coherent { 1 << 16 } else { 0 },
            features: u32::MAX,
            context: (&raw mut context.instance).cast(),
            filter: None,
            intersect: null(),
            spare: [0; 2],
        };
        query(&raw mut context, &raw mut arguments);
    }

    /// The nearest hit of one ray of a packet.
    pub fn closest(&self, packet: &Packet, lane: usize, accept: impl FnMut(usize, &Hit) -> bool) -> Option<Hit> {
        let mut ray = one(packet, lane);
        self.with_context(false, accept, |context, arguments| {
            // SAFETY: scene, context and ray are valid and not used elsewhere meanwhile.
            unsafe {
                match &self.embree.trace {
                    Trace::Three { intersect1, .. } => intersect1(self.scene, context, &raw mut ray),
                    Trace::Four { intersect1, .. } => intersect1(self.scene, &raw mut ray, arguments),
                }
            }
        });
        self.hit(&ray, 0)
    }

    /// Whether one ray of a packet hits anything.
    pub fn occluded(&self, packet: &Packet, lane: usize, accept: impl FnMut(usize, &Hit) -> bool) -> bool {
        let mut ray = one(packet, lane);
        self.with_context(false, accept, |context, arguments| {
            // SAFETY: scene, context and ray are valid and not used elsewhere meanwhile.
            unsafe {
                match &self.embree.trace {
                    Trace::Three { occluded1, .. } => occluded1(self.scene, context, &raw mut ray),
                    Trace::Four { occluded1, .. } => occluded1(self.scene, &raw mut ray, arguments),
                }
            }
        });
        ray.far[0] < 0.0
    }

    /// Calls `found` with the nearest hits of a packet.
    pub fn closest16(
        &self,
        packet: &Packet,
        coherent: bool,
        accept: impl FnMut(usize, &Hit) -> bool,
        mut found: impl FnMut(usize, Hit),
    ) {
        let (mut rays, valid) = (sixteen(packet), valid(packet.active));
        self.with_context(coherent, accept, |context, arguments| {
            // SAFETY: scene, context and rays are valid, aligned to 64 and not used elsewhere meanwhile.
            unsafe {
                match &self.embree.trace {
                    Trace::Three { intersect16, .. } => {
                        intersect16(valid.0.as_ptr(), self.scene, context, &raw mut rays);
                    }
                    Trace::Four { intersect16, .. } => {
                        intersect16(valid.0.as_ptr(), self.scene, &raw mut rays, arguments);
                    }
                }
            }
        });
        for lane in packet.lanes() {
            if let Some(hit) = self.hit(&rays, lane) {
                found(lane, hit);
            }
        }
    }

    /// A mask of the rays of a packet that hit anything.
    pub fn occluded16(&self, packet: &Packet, coherent: bool, accept: impl FnMut(usize, &Hit) -> bool) -> u16 {
        let (mut rays, valid) = (sixteen(packet), valid(packet.active));
        self.with_context(coherent, accept, |context, arguments| {
            // SAFETY: scene, context and rays are valid, aligned to 64 and not used elsewhere meanwhile.
            unsafe {
                match &self.embree.trace {
                    Trace::Three { occluded16, .. } => occluded16(valid.0.as_ptr(), self.scene, context, &raw mut rays),
                    Trace::Four { occluded16, .. } => {
                        occluded16(valid.0.as_ptr(), self.scene, &raw mut rays, arguments)
                    }
                }
            }
        });
        rays.far.iter().enumerate().fold(0, |mask, (lane, far)| mask | u16::from(*far < 0.0) << lane) & packet.active
    }

    /// Runs the query of [`Self::closest16`] or [`Self::occluded16`] on many packets as one stream (version 3 only). `buffer` is
    /// reused from call to call.
    pub fn stream(
        &self,
        packets: &[Packet],
        coherent: bool,
        closest: bool,
        buffer: &mut StreamBuffer,
        mut found: impl FnMut(usize, Option<Hit>),
    ) {
        let Trace::Three { intersect_stream, occluded_stream, .. } = &self.embree.trace else {
            unreachable!("only version 3 has streams")
        };
        let count = buffer.fill(packets);
        let rows = buffer.rows.each_mut().map(|row| row.as_mut_ptr());
        let rays = StreamRays(std::array::from_fn(|index| rows[index].cast()));
        let hits = std::array::from_fn(|index| rows[12 + index].cast());
        let stream = Stream { rays, hits };
        self.with_context(
            coherent,
            |_, _| true,
            |context, _| {
                // SAFETY: every row is as long as the stream, rows are not used elsewhere meanwhile.
                unsafe {
                    if closest {
                        intersect_stream(self.scene, context, &raw const stream, count as u32);
                    } else {
                        occluded_stream(self.scene, context, &raw const stream.rays, count as u32);
                    }
                }
            },
        );
        // Embree's results are read through the same pointers that it wrote through.
        // SAFETY: `row` is below 20, and `ray` below the length of every row.
        let at = |row: usize, ray: usize| unsafe { *rows[row].add(ray) };
        for ray in 0..count {
            let id = buffer.origin_of[ray] as usize;
            if closest {
                let [primitive, geometry] = [17, 18].map(|row| at(row, ray).to_bits());
                let hit = (geometry != INVALID).then(|| Hit {
                    t: at(8, ray),
                    triangle: self.id(geometry, primitive),
                    u: at(15, ray),
                    v: at(16, ray),
                });
                found(id, hit);
            } else {
                found(id, (at(8, ray) < 0.0).then_some(Hit { t: 0.0, triangle: 0, u: 0.0, v: 0.0 }));
            }
        }
    }

    fn hit<const N: usize>(&self, ray: &RayHit<N>, lane: usize) -> Option<Hit> {
        (ray.geometry[lane] != INVALID).then(|| Hit {
            t: ray.far[lane],
            triangle: self.id(ray.geometry[lane], ray.primitive[lane]),
            u: ray.u[lane],
            v: ray.v[lane],
        })
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: this value owns both handles, and no thread traces any more.
        unsafe {
            (self.embree.functions.release_scene)(self.scene);
            (self.embree.functions.release_device)(self.device);
        }
        self.device = null_mut();
    }
}

unsafe extern "C" fn filter3(arguments: *const FilterArguments) {
    // SAFETY: version 3 hands over the context of the query.
    unsafe { filter(arguments, (*(*arguments).context.cast::<Context>()).asker) }
}

unsafe extern "C" fn filter4(arguments: *const FilterArguments) {
    // SAFETY: version 4 hands over the part of the context that the query passed to it.
    unsafe {
        let part = (*arguments).context.cast::<u8>();
        let context = part.sub(std::mem::offset_of!(Context, instance)).cast::<Context>();
        filter(arguments, (*context).asker);
    }
}

/// Asks about each candidate hit, and invalidates hits that the closure refuses.
unsafe fn filter(arguments: *const FilterArguments, asker: *const Asker) {
    // SAFETY: Embree's arrays have `count` lanes a row, in the order of `RTCRayN` and `RTCHitN`; the asker lives as long
    // as the query.
    unsafe {
        let FilterArguments { valid, ray, hit, count, .. } = &*arguments;
        let count = *count as usize;
        for lane in 0..count {
            if *valid.add(lane) == 0 {
                continue;
            }
            let of_hit = |row: usize| *hit.add(row * count + lane);
            let tuv = [*ray.add(8 * count + lane), of_hit(3), of_hit(4)];
            let (primitive, geometry) = (of_hit(5).to_bits(), of_hit(6).to_bits());
            if !((*asker).call)((*asker).closure, lane, geometry, primitive, tuv) {
                *valid.add(lane) = 0;
            }
        }
    }
}
