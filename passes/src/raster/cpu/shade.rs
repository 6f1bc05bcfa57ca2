//! Attributes and colours of the pixels of a tile; each pixel is computed once, when its nearest triangle is known.

pub(super) mod lights;

use super::frame::{Frame, Part, Placed};
use super::interpolate::{Barycentric, Mapping, Perspective, attribute, nearest};
use super::surface::{TILE, TileSurface};
use super::tile::{LANES, Tile};
use curitiba_pipeline::backend::{NO_TRIANGLE, Shade};
use curitiba_pipeline::scene::texture::{Place, Texture};
use curitiba_pipeline::scene::{Batch, TriangleRanges, normal_map};
use glam::{Vec2, Vec3, Vec4};
use std::ops::Range;

/// Ambient share of the diffuse colour, as in the 2014 report that the README names.
const AMBIENT: f32 = 0.3;

/// A normal whose squared length is at most this has no direction: the corners' normals cancel, and the rest is
/// rounding error. Smaller squares have also lost digits, so that the normal would not get length 1.
const LEAST_SQUARE: f32 = 1e-30;

/// Floats in a row. Vectors that start in the last columns reach beyond the tile.
const ROW: usize = TILE + LANES;

type Row = [f32; ROW];
type WideRow = [f64; ROW];

/// One row of a tile, as one array for each quantity, so that the same loops compute all pixels, whatever they show.
///
/// First, each run of pixels that show the same triangle copies its inputs into its columns. Then loops over the whole
/// row compute. Columns that show nothing, and those beyond the tile, hold old values and are never stored.
#[derive(Debug)]
pub(super) struct Rows {
    /// Barycentric coordinates as in [`Barycentric`], from column 0 of the tile.
    edges: [WideRow; 2],
    right: [WideRow; 2],
    area: WideRow,
    scale: WideRow,
    inv_w: [Row; 3],
    u: Row,
    v: Row,
    inv_sum: Row,
    /// The attribute at corner 0, which interpolation replaces by the attribute at the pixel; then the differences of corners 1 and 2
    /// from corner 0.
    position: [[Row; 3]; 3],
    normal: [[Row; 3]; 3],
    light: Row,
    /// With several lights or a positional light: the sum of the arriving colours, and as fourth component the greatest cosine.
    arriving: [Row; 4],
    diffuse: [Row; 4],
    unlit: [Row; 4],
    texel: [Row; 4],
    /// Vertex colours, laid out as `position`.
    tint: [[Row; 4]; 3],
    /// The emitted light, and its texture or [`NO_TEXTURE`].
    glow: [Row; 3],
    glow_texture: [u32; ROW],
    /// Tangents, laid out as `position`; each pixel's normal map, or [`NO_TEXTURE`], and the map's scale; then the bent
    /// normal and its light cosine.
    tangent: [[Row; 4]; 3],
    normal_map: [u32; ROW],
    normal_scale: Row,
    bent: [Row; 4],
    /// Each pixel's texture, or [`NO_TEXTURE`], and its mapping.
    texture: [u32; ROW],
    mapping: MappingRows,
    /// Where the texture is read: texture coordinates from the left and from the top, and the level of detail.
    place: [Row; 3],
    triangle: [u32; ROW],
    batch: Batch,
}

/// Texture index of pixels without a texture.
const NO_TEXTURE: u32 = u32::MAX;

/// A [`Mapping`] for each pixel of a row.
#[derive(Debug)]
struct MappingRows {
    corners: [[Row; 2]; 3],
    right: [Row; 2],
    down: [Row; 2],
    size: [Row; 2],
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            edges: [[0.0; ROW]; 2],
            right: [[0.0; ROW]; 2],
            area: [0.0; ROW],
            scale: [0.0; ROW],
            inv_w: [[0.0; ROW]; 3],
            u: [0.0; ROW],
            v: [0.0; ROW],
            inv_sum: [0.0; ROW],
            position: [[[0.0; ROW]; 3]; 3],
            normal: [[[0.0; ROW]; 3]; 3],
            light: [0.0; ROW],
            arriving: [[0.0; ROW]; 4],
            diffuse: [[0.0; ROW]; 4],
            unlit: [[0.0; ROW]; 4],
            texel: [[0.0; ROW]; 4],
            tint: [[[0.0; ROW]; 4]; 3],
            glow: [[0.0; ROW]; 3],
            glow_texture: [NO_TEXTURE; ROW],
            tangent: [[[0.0; ROW]; 4]; 3],
            normal_map: [NO_TEXTURE; ROW],
            normal_scale: [0.0; ROW],
            bent: [[0.0; ROW]; 4],
            texture: [NO_TEXTURE; ROW],
            mapping: MappingRows {
                corners: [[[0.0; ROW]; 2]; 3],
                right: [[0.0; ROW]; 2],
                down: [[0.0; ROW]; 2],
                size: [[0.0; ROW]; 2],
            },
            place: [[0.0; ROW]; 3],
            triangle: [NO_TRIANGLE; ROW],
            batch: Batch { material: 0, first: 0, count: 0 },
        }
    }
}

/// Copies a value to a column and the seven after it. The next run overwrites the columns beyond this run.
#[inline(always)]
fn spread<T: Copy>(row: &mut [T; ROW], column: usize, value: T) {
    // The column is in the tile, so the remainder changes nothing; it lets the compiler remove the bounds checks.
    let column = column % TILE;
    let lanes: &mut [T; LANES] = (&mut row[column..column + LANES]).try_into().expect("as many as lanes");
    *lanes = [value; LANES];
}

/// The attributes that a tile needs.
#[derive(Clone, Copy)]
struct Wanted {
    color: bool,
    position: bool,
    normals: bool,
    light: bool,
    /// Whether the job has several lights or a positional light.
    many: bool,
    texture: bool,
    glow: bool,
    tint: bool,
    bent: bool,
}

fn glow_texture(shade: &Shade) -> Option<u32> {
    shade.glow.and_then(|glow| glow.texture)
}

/// Writes the attachments of a tile.
#[inline(always)]
pub(super) fn shade(frame: &Frame<'_>, tile: &Tile, rows: &mut Rows, surface: &mut TileSurface<'_>) {
    let asked = frame.job.attachments;
    let many = !frame.job.lights.is_empty();
    let shines = frame.job.sun.is_some() || many;
    let light = shines && (asked.color || asked.position) && !frame.geometry.normals.is_empty();
    let shades = || frame.job.shades.iter();
    let glow = asked.color && shades().any(|shade| shade.glow.is_some());
    let texture = asked.color && shades().any(|shade| shade.texture.is_some() || glow_texture(shade).is_some());
    let tint = asked.color && shades().any(|shade| shade.vertex_colors);
    let normals = light || asked.normal;
    let bent = normals && shades().any(|shade| shade.normal_map.is_some());
    let position = asked.position || many && light;
    let wanted = Wanted { color: asked.color, position, normals, light, many, texture, glow, tint, bent };
    rows.batch.count = 0;
    if !light {
        rows.light.fill(0.0);
    }
    for row in 0..surface.height {
        match tile.row(row) {
            Some(parts) => rows.shade(frame, wanted, parts, row, surface),
            None => clear(frame, row, surface),
        }
    }
}

fn clear(frame: &Frame<'_>, row: usize, surface: &mut TileSurface<'_>) {
    if frame.job.load_store.load_color {
        return;
    }
    if let Some(pixels) = surface.color(row) {
        pixels.fill(frame.job.clear_color.to_array());
    }
    if let Some(pixels) = surface.position(row) {
        pixels.fill([0.0; 4]);
    }
    if let Some(pixels) = surface.normal(row) {
        pixels.fill([0.0; 4]);
    }
    if let Some(pixels) = surface.triangle(row) {
        pixels.fill(NO_TRIANGLE);
    }
}

impl Rows {
    #[inline(always)]
    fn shade(
        &mut self,
        frame: &Frame<'_>,
        wanted: Wanted,
        parts: &[u32; TILE],
        row: usize,
        surface: &mut TileSurface<'_>,
    ) {
        let mut column = 0;
        while column < surface.width {
            let part = parts[column];
            let mut end = column + 1;
            while end < surface.width && parts[end] == part {
                end += 1;
            }
            if part == Part::NONE.0 {
                self.triangle[column..end].fill(NO_TRIANGLE);
            } else {
                self.gather(frame, wanted, Part(part), column..end, (surface.x, surface.y + row));
            }
            column = end;
        }
        self.interpolate(wanted);
        if wanted.texture {
            self.texels(&frame.job.scene.textures, surface.width);
        }
        if wanted.glow {
            self.glow_texels(&frame.job.scene.textures, surface.width);
        }
        if wanted.bent {
            self.bend(frame, surface.width);
        }
        if wanted.normals {
            self.light(frame, wanted);
        }
        if wanted.many {
            self.light_by_many(frame, wanted);
        }
        if wanted.bent {
            self.take_bent(wanted, surface.width);
        }
        let over = frame.job.load_store.load_color;
        if let Some(pixels) = surface.color(row) {
            self.color(frame, wanted);
            let [r, g, b, a] = &self.unlit;
            store(pixels, &self.triangle, [r, g, b, a], frame.job.clear_color.to_array(), over);
        }
        let sky = &frame.geometry.sky;
        if !sky.is_empty() {
            self.hide_sky(sky);
        }
        if let Some(pixels) = surface.position(row) {
            let [x, y, z] = &self.position[0];
            store(pixels, &self.triangle, [x, y, z, &self.light], [0.0; 4], over);
        }
        if let Some(pixels) = surface.normal(row) {
            let [x, y, z] = &self.normal[0];
            store(pixels, &self.triangle, [x, y, z, &[0.0; ROW]], [0.0; 4], over);
        }
        if let Some(pixels) = surface.triangle(row) {
            if over || !sky.is_empty() {
                let shown = |id: u32| if sky.contains(id) { NO_TRIANGLE } else { id };
                let drawn = pixels.iter_mut().zip(&self.triangle).filter(|(_, id)| !over || **id != NO_TRIANGLE);
                drawn.for_each(|(pixel, id)| *pixel = shown(*id));
            } else {
                pixels.copy_from_slice(&self.triangle[..pixels.len()]);
            }
        }
    }

    /// Clears the position, normal and light cosine of the pixels of a sky, which have only a colour.
    #[cold]
    fn hide_sky(&mut self, sky: &TriangleRanges) {
        let Self { triangle, position: [position, ..], normal: [normal, ..], light, .. } = self;
        for (column, _) in triangle.iter().enumerate().filter(|(_, id)| sky.contains(**id)) {
            for axis in 0..3 {
                (position[axis][column], normal[axis][column]) = (0.0, 0.0);
            }
            light[column] = 0.0;
        }
    }

    /// Copies a part's attributes and material into the columns `run` of the pixels that show the part.
    #[inline(always)]
    fn gather(&mut self, frame: &Frame<'_>, wanted: Wanted, part: Part, run: Range<usize>, (left, y): (usize, usize)) {
        let geometry = frame.geometry;
        let placed = frame.place(part);
        if !(wanted.position | wanted.normals | wanted.color) {
            self.triangle[run].fill(placed.triangle);
            return;
        }
        let barycentric = Barycentric::new(frame, &placed.corners, left as i32, y as i32);
        let columns = || run.clone().step_by(LANES);
        for column in columns() {
            spread(&mut self.triangle, column, placed.triangle);
            for corner in 0..2 {
                spread(&mut self.edges[corner], column, barycentric.edges[corner]);
                spread(&mut self.right[corner], column, barycentric.right[corner]);
            }
            spread(&mut self.area, column, barycentric.area);
            spread(&mut self.scale, column, barycentric.scale);
            for corner in 0..3 {
                spread(&mut self.inv_w[corner], column, barycentric.inv_w[corner]);
            }
        }
        self.place_outside(&barycentric, run.clone(), |column| {
            nearest(frame, &placed.corners, left as i32 + column as i32, y as i32)
        });
        if wanted.position {
            spread_corners(
                &mut self.position,
                columns(),
                attribute(frame, &placed, &geometry.positions).map(|corner| corner.to_array()),
            );
        }
        if wanted.normals {
            spread_corners(
                &mut self.normal,
                columns(),
                attribute(frame, &placed, &geometry.normals).map(|corner| corner.to_array()),
            );
        }
        if wanted.color || wanted.bent {
            if placed.triangle.wrapping_sub(self.batch.first) >= self.batch.count {
                let next = geometry.batches.partition_point(|batch| batch.first <= placed.triangle);
                self.batch = geometry.batches[next - 1];
            }
            let shade = &frame.job.shades[self.batch.material as usize];
            if wanted.color {
                self.material(frame, wanted, shade, &placed, run.clone());
            }
            if wanted.bent {
                self.normal_map(frame, shade, &placed, run.clone());
            }
            let color = shade.texture.or(glow_texture(shade)).filter(|_| wanted.color);
            let normals = shade.normal_map.map(|map| map.texture).filter(|_| wanted.bent);
            if let Some(texture) = color.or(normals) {
                let size = frame.job.scene.textures[texture as usize].size();
                let mapping =
                    barycentric.mapping(attribute(frame, &placed, &geometry.texcoords), size, frame.job.view.footprint);
                for column in run.step_by(LANES) {
                    self.mapping.spread(column, &mapping);
                }
            }
        }
    }

    /// Gives pixels outside their triangle the barycentric coordinates of the triangle's point nearest to the pixel. Such pixels lie at the
    /// ends of a run.
    #[inline(always)]
    fn place_outside(&mut self, barycentric: &Barycentric, run: Range<usize>, nearest: impl Fn(usize) -> [f64; 2]) {
        let mut place = |column: usize| {
            let is_outside = barycentric.is_outside(column as f64);
            if is_outside {
                (self.area[column], self.scale[column]) = (1.0, 1.0);
                for (corner, coordinate) in nearest(column).into_iter().enumerate() {
                    (self.edges[corner][column], self.right[corner][column]) = (coordinate, 0.0);
                }
            }
            is_outside
        };
        let Some(first) = run.clone().find(|column| !place(*column)) else { return };
        for column in (first + 1..run.end).rev() {
            if !place(column) {
                break;
            }
        }
    }

    /// Computes the perspective-correct attributes of the whole row.
    #[inline(always)]
    fn interpolate(&mut self, wanted: Wanted) {
        if !(wanted.position | wanted.normals | wanted.texture | wanted.tint | wanted.bent) {
            return;
        }
        let Self { edges: [edge1, edge2], right: [right1, right2], inv_w: [inv_w0, inv_w1, inv_w2], .. } = self;
        for column in 0..TILE {
            let (e1, e2) = (
                edge1[column] + right1[column] * column as i32 as f64,
                edge2[column] + right2[column] * column as i32 as f64,
            );
            let e0 = self.area[column] - e1 - e2;
            let w0 = (e0 * self.scale[column]) as f32 * inv_w0[column];
            let w1 = (e1 * self.scale[column]) as f32 * inv_w1[column];
            let w2 = (e2 * self.scale[column]) as f32 * inv_w2[column];
            let Perspective { u, v, inv_sum } = Perspective::new([w0, w1, w2]);
            (self.u[column], self.v[column], self.inv_sum[column]) = (u, v, inv_sum);
        }
        if wanted.position {
            blend(&mut self.position, &self.u, &self.v);
        }
        if wanted.normals {
            blend(&mut self.normal, &self.u, &self.v);
        }
        if wanted.tint {
            blend(&mut self.tint, &self.u, &self.v);
        }
        if wanted.bent {
            blend(&mut self.tangent, &self.u, &self.v);
        }
    }

    /// Copies the tangents of a part and its normal map, if it has one.
    #[inline(always)]
    fn normal_map(&mut self, frame: &Frame<'_>, shade: &Shade, placed: &Placed<'_>, run: Range<usize>) {
        let columns = || run.clone().step_by(LANES);
        let Some(map) = shade.normal_map else {
            columns().for_each(|column| spread(&mut self.normal_map, column, NO_TEXTURE));
            return;
        };
        let tangents = attribute(frame, placed, &frame.geometry.tangents).map(|corner| corner.to_array());
        spread_corners(&mut self.tangent, columns(), tangents);
        for column in columns() {
            spread(&mut self.normal_map, column, map.texture);
            spread(&mut self.normal_scale, column, map.scale);
        }
    }

    #[inline(always)]
    fn material(&mut self, frame: &Frame<'_>, wanted: Wanted, shade: &Shade, placed: &Placed<'_>, run: Range<usize>) {
        if wanted.tint {
            let white = [Vec4::ONE; 3];
            let colors = if shade.vertex_colors { attribute(frame, placed, &frame.geometry.colors) } else { white };
            spread_corners(&mut self.tint, run.clone().step_by(LANES), colors.map(|corner| corner.to_array()));
        }
        let unlit = if shade.texture.is_some() { shade.emission + AMBIENT } else { shade.diffuse * AMBIENT };
        for column in run.step_by(LANES) {
            for component in 0..4 {
                spread(&mut self.diffuse[component], column, shade.diffuse[component]);
                spread(&mut self.unlit[component], column, unlit[component]);
            }
            if wanted.texture {
                spread(&mut self.texture, column, shade.texture.unwrap_or(NO_TEXTURE));
            }
            if wanted.glow {
                let color = shade.glow.map_or(Vec3::ZERO, |glow| glow.color);
                for component in 0..3 {
                    spread(&mut self.glow[component], column, color[component]);
                }
                spread(&mut self.glow_texture, column, glow_texture(shade).unwrap_or(NO_TEXTURE));
            }
        }
    }

    /// The index of the texture that a pixel shows; `None` where it shows none.
    #[inline(always)]
    fn texture_at(&self, column: usize) -> Option<usize> {
        let texture = self.texture[column];
        (self.triangle[column] != NO_TRIANGLE && texture != NO_TEXTURE).then_some(texture as usize)
    }

    /// Samples the textures of the row: computes texture coordinates and levels of detail for all pixels at once, then reads texels pixel
    /// by pixel.
    #[inline(always)]
    fn texels(&mut self, textures: &[Texture], width: usize) {
        if (0..width).any(|column| self.texture_at(column).is_some()) {
            let Self { u, v, inv_sum, inv_w, mapping, place: [right, down, level], .. } = self;
            for column in 0..TILE {
                let perspective = Perspective { u: u[column], v: v[column], inv_sum: inv_sum[column] };
                let inv_w = [inv_w[0][column], inv_w[1][column], inv_w[2][column]];
                let (place, lod) = mapping.get(column).at(perspective, inv_w);
                (right[column], down[column], level[column]) = (place.right, place.down, lod);
            }
        }
        for column in 0..width {
            let [right, down, lod] = [0, 1, 2].map(|part: usize| self.place[part][column]);
            let texel = match self.texture_at(column) {
                Some(texture) => {
                    let texture = &textures[texture];
                    let mut place = Place { right, down };
                    if !texture.repeats() {
                        place = texture.place(self.mapping.get(column).uv(self.u[column], self.v[column]));
                    }
                    texture.sample_at(place, lod)
                }
                None => Vec4::ONE,
            };
            for component in 0..4 {
                self.texel[component][column] = texel[component];
            }
        }
    }

    /// Multiplies the emitted light by its texture, pixel by pixel, because few pixels emit light.
    #[inline(always)]
    fn glow_texels(&mut self, textures: &[Texture], width: usize) {
        for column in 0..width {
            let texture = self.glow_texture[column];
            if self.triangle[column] == NO_TRIANGLE || texture == NO_TEXTURE {
                continue;
            }
            let texel = self.texel_of(&textures[texture as usize], column);
            for component in 0..3 {
                self.glow[component][column] *= texel[component];
            }
        }
    }

    /// The value, at a pixel, of a texture other than [`Self::texture`] that has the same texture coordinates.
    #[inline(always)]
    fn texel_of(&self, texture: &Texture, column: usize) -> Vec4 {
        let perspective = Perspective { u: self.u[column], v: self.v[column], inv_sum: self.inv_sum[column] };
        let inv_w = [0, 1, 2].map(|corner: usize| self.inv_w[corner][column]);
        let mapping = Mapping { size: texture.size(), ..self.mapping.get(column) };
        let (_, lod) = mapping.at(perspective, inv_w);
        texture.sample(mapping.uv(perspective.u, perspective.v), lod)
    }

    /// Whether a normal map bends a pixel's normal.
    #[inline(always)]
    fn is_bent(&self, column: usize) -> bool {
        self.triangle[column] != NO_TRIANGLE && self.normal_map[column] != NO_TEXTURE
    }

    /// Bends the interpolated normals by the normal maps, pixel by pixel, into separate rows.
    #[inline(always)]
    fn bend(&mut self, frame: &Frame<'_>, width: usize) {
        let to_light = frame.job.sun.map_or(Vec3::ZERO, |sun| -sun.direction);
        let (mut triangle, mut flat) = (NO_TRIANGLE, Vec3::ZERO);
        for column in 0..width {
            if !self.is_bent(column) {
                continue;
            }
            if triangle != self.triangle[column] {
                triangle = self.triangle[column];
                let [a, b, c] = frame.geometry.corners(triangle);
                flat = (b - a).cross(c - a).normalize_or_zero();
            }
            let [x, y, z] = &self.normal[0];
            let normal = Vec3::new(x[column], y[column], z[column]);
            let mut bent = Vec4::ZERO;
            if normal.length_squared() > LEAST_SQUARE {
                let texture = &frame.job.scene.textures[self.normal_map[column] as usize];
                let texel = self.texel_of(texture, column).truncate();
                let tangent = Vec4::from_array([0, 1, 2, 3].map(|axis: usize| self.tangent[0][axis][column]));
                let unit = normal_map::bent(texel, self.normal_scale[column], normal, tangent, flat);
                bent = unit.extend(normal_map::cosine(unit, normal, to_light));
            }
            for component in 0..4 {
                self.bent[component][column] = bent[component];
            }
        }
    }

    /// Replaces the interpolated normals and their light cosines by the bent ones, at pixels with a normal map.
    #[inline(always)]
    fn take_bent(&mut self, wanted: Wanted, width: usize) {
        for column in 0..width {
            if !self.is_bent(column) {
                continue;
            }
            for axis in 0..3 {
                self.normal[0][axis][column] = self.bent[axis][column];
            }
            self.light[column] = if wanted.light { self.bent[3][column] } else { 0.0 };
        }
    }

    /// Normalises the normals, and computes the light cosines.
    #[inline(always)]
    fn light(&mut self, frame: &Frame<'_>, wanted: Wanted) {
        let towards = frame.job.sun.map_or(Vec3::ZERO, |sun| -sun.direction);
        let [nx, ny, nz] = &mut self.normal[0];
        for column in 0..TILE {
            let (x, y, z) = (nx[column], ny[column], nz[column]);
            let squared = x * x + y * y + z * z;
            let scale = if squared > LEAST_SQUARE { 1.0 / squared.sqrt() } else { 0.0 };
            let (x, y, z) = (x * scale, y * scale, z * scale);
            (nx[column], ny[column], nz[column]) = (x, y, z);
            let cosine = x * towards.x + y * towards.y + z * towards.z;
            // Rounding can make the product of two unit vectors slightly more than 1.
            self.light[column] = if wanted.light & (cosine > 0.0) { cosine.min(1.0) } else { 0.0 };
        }
    }

    /// Computes the colour, which replaces the unlit colour.
    #[inline(always)]
    fn color(&mut self, frame: &Frame<'_>, wanted: Wanted) {
        let light_color = frame.job.sun.map_or(Vec4::ZERO, |sun| sun.color.extend(1.0)).to_array();
        for (component, light_color) in light_color.into_iter().enumerate() {
            let (diffuse, color) = (&self.diffuse[component], &mut self.unlit[component]);
            if wanted.many {
                let arriving = &self.arriving[component];
                for column in 0..TILE {
                    color[column] += diffuse[column] * arriving[column];
                }
            } else {
                for column in 0..TILE {
                    color[column] += diffuse[column] * light_color * self.light[column];
                }
            }
            if wanted.texture {
                color.iter_mut().zip(&self.texel[component]).for_each(|(color, texel)| *color *= texel);
            }
            if wanted.tint {
                color.iter_mut().zip(&self.tint[0][component]).for_each(|(color, tint)| *color *= tint);
            }
            if wanted.glow
                && let Some(glow) = self.glow.get(component)
            {
                color.iter_mut().zip(glow).for_each(|(color, glow)| *color += glow);
            }
        }
    }
}

impl MappingRows {
    /// Copies a mapping to a column and the seven after it.
    #[inline(always)]
    fn spread(&mut self, column: usize, mapping: &Mapping) {
        for axis in 0..2 {
            for corner in 0..3 {
                spread(&mut self.corners[corner][axis], column, mapping.corners[corner][axis]);
            }
            spread(&mut self.right[axis], column, mapping.right[axis]);
            spread(&mut self.down[axis], column, mapping.down[axis]);
            spread(&mut self.size[axis], column, mapping.size[axis]);
        }
    }

    /// The mapping of a pixel.
    #[inline(always)]
    fn get(&self, column: usize) -> Mapping {
        let two = |rows: &[Row; 2]| [rows[0][column], rows[1][column]];
        Mapping {
            corners: [0, 1, 2].map(|corner: usize| Vec2::from_array(two(&self.corners[corner]))),
            right: two(&self.right),
            down: two(&self.down),
            size: Vec2::from_array(two(&self.size)),
        }
    }
}

#[inline(always)]
fn spread_corners<const N: usize>(
    rows: &mut [[Row; N]; 3],
    columns: impl Iterator<Item = usize>,
    [a, b, c]: [[f32; N]; 3],
) {
    let [first, second, third] = rows;
    for column in columns {
        for component in 0..N {
            spread(&mut first[component], column, a[component]);
            spread(&mut second[component], column, b[component] - a[component]);
            spread(&mut third[component], column, c[component] - a[component]);
        }
    }
}

#[inline(always)]
fn blend<const N: usize>([first, second, third]: &mut [[Row; N]; 3], u: &Row, v: &Row) {
    for component in 0..N {
        let (first, second, third) = (&mut first[component], &second[component], &third[component]);
        for column in 0..TILE {
            first[column] += u[column] * second[column] + v[column] * third[column];
        }
    }
}

/// Writes a row. Pixels without a triangle get the background, or keep their values if the row is drawn `over` loaded contents.
#[inline(always)]
fn store(pixels: &mut [[f32; 4]], triangles: &[u32; ROW], components: [&Row; 4], background: [f32; 4], over: bool) {
    if over {
        let [x, y, z, w] = components;
        for (column, pixel) in pixels.iter_mut().enumerate().filter(|(column, _)| triangles[*column] != NO_TRIANGLE) {
            *pixel = [x[column], y[column], z[column], w[column]];
        }
        return;
    }
    let mut output = [[0u32; TILE]; 4];
    for component in 0..4 {
        let (input, background) = (components[component], background[component].to_bits());
        for column in 0..TILE {
            let empty = if triangles[column] == NO_TRIANGLE { u32::MAX } else { 0 };
            output[component][column] = (background & empty) | (input[column].to_bits() & !empty);
        }
    }
    let [x, y, z, w] = output;
    for ((((pixel, x), y), z), w) in pixels.iter_mut().zip(&x).zip(&y).zip(&z).zip(&w) {
        *pixel = [f32::from_bits(*x), f32::from_bits(*y), f32::from_bits(*z), f32::from_bits(*w)];
    }
}
