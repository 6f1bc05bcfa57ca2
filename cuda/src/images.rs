//! Images and tables in device memory that passes share.

use crate::device::{Address, Buffer, Device};
use crate::focused::{self, FocusedTables};
use crate::layout::{self, Body, PhotonCloud, Ways};
use crate::ways::WayTables;
use cudarc::driver::DeviceRepr;
use curitiba_passes::effects::dielectric::{Cloud, PhotonMap};
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
    /// The ways of each pixel, for a sample.
    pub samples: Buffer<u32>,
    pub ways: Table<Ways>,
    /// The light that glass focuses.
    pub focused: FocusedBuffers,
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
        let tables_of_ways = self.faces.bytes() + self.strata.bytes() + self.facets.bytes();
        let ways = tables_of_ways + self.samples.bytes() + self.ways.bytes();
        let others = [self.triangle.bytes(), self.counts.bytes(), materials, lights, ways, self.focused.bytes()];
        [&attachments[..], &tables, &others].concat().iter().sum()
    }

    /// Copies the parameters and tables for paths in glass that split or are cut off.
    /// `samples` are the ways of each pixel of a sample ([`Sampling`](curitiba_passes::adaptive::Sampling)); empty if they are not listed.
    pub fn set_ways(&mut self, device: &Device, tables: WayTables, samples: &[[u32; 4]]) -> Result<(), BackendError> {
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
        let samples = device.replace_all("the ways of each pixel", &mut self.samples, &[samples.as_flattened()])?[0];
        self.ways.set(device, "what is asked of paths in glass", vec![Ways { faces, strata, facets, samples, ..ways }])
    }
}

/// The tables of the light that glass focuses.
#[derive(Debug, Default)]
pub(crate) struct FocusedBuffers {
    list: Table<layout::Lens>,
    nodes: Table<layout::Turned>,
    points: Table<f64>,
    by_sphere: Table<u32>,
    /// The photons of all targets, word by word.
    photons: Buffer<u32>,
    /// The tables of cells of all targets.
    starts: Buffer<u32>,
    clouds: Table<PhotonCloud>,
    pub described: Table<layout::Focused>,
}

impl FocusedBuffers {
    /// Copies the tables and the photons to the device.
    pub fn set(&mut self, device: &Device, tables: FocusedTables, photons: &PhotonMap) -> Result<(), BackendError> {
        let FocusedTables { list, nodes, points, by_sphere, described } = tables;
        self.list.set(device, "the spheres that focus light", list)?;
        self.nodes.set(device, "the rays of spheres that focus light", nodes)?;
        self.points.set(device, "the points of focused light", points)?;
        self.by_sphere.set(device, "which spheres focus light", by_sphere)?;
        self.set_photons(device, photons.clouds())?;
        let described = layout::Focused {
            list: self.list.address(device),
            nodes: self.nodes.address(device),
            points: self.points.address(device),
            by_sphere: self.by_sphere.address(device),
            clouds: self.clouds.address(device),
            ..described
        };
        self.described.set(device, "where the light is that glass focuses", vec![described])
    }

    /// Copies the photons to the device. They differ in each batch of samples, so the host keeps no copy for comparison.
    fn set_photons(&mut self, device: &Device, clouds: &[Cloud]) -> Result<(), BackendError> {
        let photons: Vec<&[u32]> = clouds.iter().map(|cloud| bytemuck::cast_slice(cloud.photons())).collect();
        let starts: Vec<&[u32]> = clouds.iter().map(Cloud::starts).collect();
        let photons = device.replace_all("the photons", &mut self.photons, &photons)?;
        let starts = device.replace_all("the cells of the photons", &mut self.starts, &starts)?;
        let places = clouds.iter().zip(photons.into_iter().zip(starts));
        let described = |(cloud, (photons, starts))| PhotonCloud { photons, starts, ..focused::cloud(cloud) };
        self.clouds.set(device, "where the photons are", places.map(described).collect())
    }

    /// Size in bytes of device memory.
    pub fn bytes(&self) -> u64 {
        let lenses = self.list.bytes() + self.nodes.bytes() + self.points.bytes() + self.by_sphere.bytes();
        lenses + self.photons.bytes() + self.starts.bytes() + self.clouds.bytes() + self.described.bytes()
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
