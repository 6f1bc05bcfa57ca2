//! Images and tables in device memory that passes share.

use crate::device::{Address, Buffer, Device};
use crate::layout::{self, Body, Ways};
use crate::lenses::LensTables;
use crate::ways::WayTables;
use cudarc::driver::DeviceRepr;
use curitiba_pipeline::backend::BackendError;

/// Images and tables in device memory, kept from one pass to the next.
#[derive(Debug, Default)]
pub(crate) struct Images {
    pub position: Buffer<f32>,
    pub normal: Buffer<f32>,
    pub color: Buffer<f32>,
    pub triangle: Buffer<u32>,
    pub output: Buffer<f32>,
    pub counts: Buffer<u64>,
    pub sobol: Table<u32>,
    pub open_share: Table<f32>,
    pub through_glass: Table<f32>,
    pub shades: Table<layout::Shade>,
    pub bodies: Table<Body>,
    pub around_eye: Buffer<u32>,
    pub faces: Table<layout::Face>,
    /// Strata of the spectrum.
    pub strata: Table<f32>,
    /// Points from which microfacets are sampled.
    pub facets: Table<u32>,
    pub ways: Table<Ways>,
    /// The spheres that focus light.
    pub lenses: LensBuffers,
    pub lights: Table<layout::Light>,
    pub emissions: Table<f32>,
    /// Points from which directions to the discs of lights are sampled.
    pub disc: Table<u32>,
}

impl Images {
    /// Size in bytes of device memory.
    pub fn bytes(&self) -> u64 {
        let attachments = [&self.position, &self.normal, &self.color, &self.output].map(Buffer::bytes);
        let tables = [self.open_share.bytes(), self.through_glass.bytes(), self.sobol.bytes()];
        let lights = self.lights.bytes() + self.emissions.bytes() + self.disc.bytes();
        let materials = self.shades.bytes() + self.bodies.bytes() + self.around_eye.bytes();
        let ways = self.faces.bytes() + self.strata.bytes() + self.facets.bytes() + self.ways.bytes();
        let others = [self.triangle.bytes(), self.counts.bytes(), materials, lights, ways, self.lenses.bytes()];
        [&attachments[..], &tables, &others].concat().iter().sum()
    }

    /// Copies the parameters and tables for paths in glass that split or are cut off.
    pub fn set_ways(&mut self, device: &Device, tables: WayTables) -> Result<(), BackendError> {
        let WayTables { faces, strata, facets, ways } = tables;
        self.faces.set(device, "the surfaces of glass", faces)?;
        if !strata.is_empty() {
            self.strata.set(device, "the parts of the spectrum", strata)?;
        }
        if !facets.is_empty() {
            self.facets.set(device, "the points of microfacets", facets)?;
        }
        let (faces, strata, facets) =
            (self.faces.address(device), self.strata.address(device), self.facets.address(device));
        self.ways.set(device, "what is asked of paths in glass", vec![Ways { faces, strata, facets, ..ways }])
    }
}

/// The tables of the spheres that focus light.
#[derive(Debug, Default)]
pub(crate) struct LensBuffers {
    list: Table<layout::Lens>,
    nodes: Table<layout::Turned>,
    points: Table<f64>,
    by_sphere: Table<u32>,
    pub described: Table<layout::Lenses>,
}

impl LensBuffers {
    /// Copies the tables to the device.
    pub fn set(&mut self, device: &Device, tables: LensTables) -> Result<(), BackendError> {
        let LensTables { list, nodes, points, by_sphere, lenses } = tables;
        self.list.set(device, "the spheres that focus light", list)?;
        self.nodes.set(device, "the rays of spheres that focus light", nodes)?;
        self.points.set(device, "the points of focused light", points)?;
        self.by_sphere.set(device, "which spheres focus light", by_sphere)?;
        let described = layout::Lenses {
            list: self.list.address(device),
            nodes: self.nodes.address(device),
            points: self.points.address(device),
            by_sphere: self.by_sphere.address(device),
            ..lenses
        };
        self.described.set(device, "where the spheres that focus light are", vec![described])
    }

    /// Size in bytes of device memory.
    pub fn bytes(&self) -> u64 {
        self.list.bytes() + self.nodes.bytes() + self.points.bytes() + self.by_sphere.bytes() + self.described.bytes()
    }
}

/// Values that rarely change between passes; they are copied to the device only when they change.
#[derive(Debug)]
pub(crate) struct Table<T> {
    values: Vec<T>,
    buffer: Buffer<T>,
}

impl<T> Default for Table<T> {
    fn default() -> Self {
        Self { values: Vec::new(), buffer: Buffer::default() }
    }
}

impl<T: DeviceRepr + PartialEq> Table<T> {
    /// Address of the values; see [`Buffer::address`].
    pub fn address(&self, device: &Device) -> Address {
        self.buffer.address(device)
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Size in bytes of device memory.
    pub fn bytes(&self) -> u64 {
        self.buffer.bytes()
    }

    /// Makes these the values.
    ///
    /// # Errors
    /// If the device has no memory for them.
    pub fn set(&mut self, device: &Device, what: &str, values: Vec<T>) -> Result<(), BackendError> {
        if self.values != values {
            // After a failure the table is empty, so that no later pass takes old values for its own.
            self.values.clear();
            device.replace(what, &mut self.buffer, &values)?;
            self.values = values;
        }
        Ok(())
    }
}
