//! Flattens objects into one list of triangles in world space.

use super::super::error::{Budget, SceneError};
use super::super::origin::{Bounds, origin_for, placed_bounds};
use super::super::parallel::concatenate;
use super::super::{Batch, Geometry, Material, Mesh, Object, PlacedSphere};
use super::spheres::{self, Ball};
use super::texture::NO_NORMAL_MAP;
use super::{BuildOptions, FilesOfObjects, normals, tangents};
use crate::diagnostic::Warnings;
use crate::memory;
use glam::{DMat4, DVec3, Mat3, Mat4, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, Ordering};

/// Least number of triangles per task.
const GRAIN: usize = 1 << 12;

/// A run of consecutive triangles that come from one group of one object.
struct Run {
    material: u32,
    object: usize,
    group: usize,
    triangles: usize,
}

/// Whether a triangle is kept, or why it is left out.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Kept,
    BadIndex,
    NotFinite,
    Degenerate,
}

/// Marks an index out of its mesh's range; never a valid index.
const BAD: u32 = u32::MAX;

/// The placed contents of the files.
#[derive(Clone, Copy)]
pub(super) struct Placed<'a> {
    pub objects: &'a [Object],
    pub spheres: &'a [PlacedSphere],
    /// Position of the objects' origin in the files' coordinates.
    pub origin: DVec3,
}

/// Returns the triangles and spheres in world space, the factor by which lengths were scaled, and the world position of their origin.
pub(super) fn flatten(
    mut meshes: Vec<Mesh>,
    (Placed { objects, spheres: placed_spheres, origin: own }, materials): (Placed<'_>, &[Material]),
    options: &BuildOptions,
    files: &FilesOfObjects,
    budget: &mut Budget,
    warnings: &mut Warnings,
) -> Result<(Geometry, f32, DVec3), SceneError> {
    let mut uses = vec![0_u32; meshes.len()];
    for object in objects {
        uses[object.mesh as usize] += 1;
    }
    let first_users = first_users(meshes.len(), objects);
    if options.needs.normals {
        ensure_normals(&mut meshes, &first_users, &uses, files, warnings);
    }
    let colored = options.needs.colors
        && meshes.iter().zip(&uses).any(|(mesh, uses)| *uses > 0 && mesh.colors.len() == mesh.positions.len());
    if options.needs.colors {
        mend_colors(&mut meshes, &first_users, &uses, files, warnings);
    }
    let mapped: Vec<bool> = materials
        .iter()
        .map(|material| {
            let mapped = options.needs.normal_maps && material.normal_texture.is_some();
            options.needs.normals && !options.model_space_normals && (mapped || options.needs.tangents)
        })
        .collect();
    let mapped =
        meshes.iter().zip(&uses).any(|(mesh, uses)| *uses > 0 && tangents::is_mapped(mesh, &mapped)).then_some(mapped);
    let has =
        Has { texcoords: options.needs.textures || mapped.is_some(), colors: colored, tangents: mapped.is_some() };
    if has.texcoords {
        mend_texcoords(&mut meshes, &first_users, &uses, files, warnings);
    }
    if let Some(mapped) = mapped {
        ensure_tangents(&mut meshes, (&first_users, &uses), &mapped, files, budget, warnings)?;
    }
    let vertices = total_size(&meshes, objects, has, options, files, budget)?;

    // A scene that is made unit size is centred at 0 later, so its own origin has no effect.
    let own = if options.unitize { DVec3::ZERO } else { own };
    let turn = if options.swap_yz { DMat4::from_cols_array_2d(&SWAP_YZ) } else { DMat4::IDENTITY };
    let file = files.whole_scene();
    budget.take(file, "the placed spheres", (placed_spheres.len() * size_of::<Ball>()) as u64)?;
    let mut balls = spheres::placed(placed_spheres, turn * DMat4::from_translation(own), file)?;
    let in_world = |balls: &[Ball]| -> Result<Vec<Ball>, SceneError> {
        let moved = balls.iter().zip(placed_spheres).map(|(ball, placed)| {
            ball.moved(options.transform.as_dmat4()).ok_or_else(|| spheres::stretched(&placed.name, file))
        });
        moved.collect()
    };
    let to_world = |object: &Object| {
        options.transform.as_dmat4() * turn * DMat4::from_translation(own) * object.transform.as_dmat4()
    };
    let origin = match (options.origin, options.unitize) {
        (Some(origin), _) => origin,
        (None, true) => placed_bounds(&[unit_cube()], std::iter::once((0, options.transform.as_dmat4())))
            .map_or(DVec3::ZERO, origin_for),
        (None, false) => {
            let meshes = placed_bounds(&meshes, objects.iter().map(|object| (object.mesh, to_world(object))));
            let spheres = spheres::bounds(in_world(&balls)?.into_iter());
            around(meshes, spheres).map_or(DVec3::ZERO, origin_for)
        }
    };
    // Near 0 everything is placed in f32, one transform after the other.
    let exact = own != DVec3::ZERO || origin != DVec3::ZERO;

    let mut geometry = Geometry::default();
    if objects.len() > 1 {
        geometry.positions.reserve_exact(vertices);
        geometry.normals.reserve_exact(if options.needs.normals { vertices } else { 0 });
        geometry.texcoords.reserve_exact(if has.texcoords { vertices } else { 0 });
        geometry.colors.reserve_exact(if has.colors { vertices } else { 0 });
        geometry.tangents.reserve_exact(if has.tangents { vertices } else { 0 });
    }
    let mut parts: Vec<(Run, Vec<[u32; 3]>)> = Vec::new();
    for (index, object) in objects.iter().enumerate() {
        let mesh = &mut meshes[object.mesh as usize];
        uses[object.mesh as usize] -= 1;
        let last = uses[object.mesh as usize] == 0;
        let base = geometry.positions.len() as u32;
        let vertices = mesh.positions.len() as u32;
        let mirrored = (options.transform.determinant() < 0.0) != (object.transform.determinant() < 0.0);
        for (group_index, group) in mesh.groups.iter_mut().enumerate() {
            let mut triangles = claim(&mut group.triangles, last).into_owned();
            let turned = mirrored && materials.get(group.material as usize).is_some_and(|m| m.single_sided);
            triangles.par_iter_mut().for_each(|triangle| {
                *triangle = triangle.map(|vertex| if vertex < vertices { base + vertex } else { BAD });
                if turned {
                    triangle.swap(1, 2);
                }
            });
            let run = Run { material: group.material, object: index, group: group_index, triangles: triangles.len() };
            parts.push((run, triangles));
        }
        let vertices = vertices as usize;
        if has.colors {
            append_or_fill(&mut geometry.colors, &mut mesh.colors, (vertices, Vec4::ONE), last);
        }
        if has.texcoords {
            append(&mut geometry.texcoords, claim(&mut mesh.texcoords, last));
        }
        if has.tangents {
            let first = geometry.tangents.len();
            append_or_fill(&mut geometry.tangents, &mut mesh.tangents, (vertices, Vec4::ZERO), last);
            turn_tangents(&mut geometry.tangents[first..], object.transform, swap(options));
        }
        let whole = (exact && !options.unitize).then(|| DMat4::from_translation(-origin) * to_world(object));
        append_vertices(&mut geometry, mesh, last, (object.transform, whole), options);
    }
    drop(meshes);
    parts.sort_by_key(|(run, _)| run.material);
    let (mut runs, lists): (Vec<Run>, Vec<Vec<[u32; 3]>>) = parts.into_iter().unzip();
    geometry.triangles = whole(lists);

    sort_out(&mut geometry, &mut runs, objects, files, warnings);
    drop_unused_vertices(&mut geometry);
    let mut scale = 1.0;
    if options.unitize && !(geometry.positions.is_empty() && balls.is_empty()) {
        scale = unitize(&mut geometry.positions, &mut balls);
        // Rounding after the scaling may have made slivers degenerate.
        sort_out(&mut geometry, &mut runs, objects, files, warnings);
        drop_unused_vertices(&mut geometry);
    }
    if (options.transform != Mat4::IDENTITY || exact && options.unitize) && !geometry.positions.is_empty() {
        place(&mut geometry, options, exact, origin);
        sort_out(&mut geometry, &mut runs, objects, files, warnings);
        drop_unused_vertices(&mut geometry);
    }
    geometry.batches = batches(&runs);
    geometry.spheres = spheres::finished(&in_world(&balls)?, (placed_spheres, origin), file, warnings);
    if geometry.surfaces() >= u32::MAX as usize {
        return Err(SceneError::file(file, "the triangles and spheres are too many")
            .help(format!("valid: fewer than {} together", u32::MAX)));
    }
    Ok((geometry, scale, origin))
}

/// Which attributes vertices have in addition to positions and normals.
#[derive(Clone, Copy)]
struct Has {
    texcoords: bool,
    colors: bool,
    tangents: bool,
}

/// Adds up the memory that the objects need, books it, and returns the number of vertices.
fn total_size(
    meshes: &[Mesh],
    objects: &[Object],
    has: Has,
    options: &BuildOptions,
    files: &FilesOfObjects,
    budget: &mut Budget,
) -> Result<usize, SceneError> {
    let sizes: Vec<[u64; 3]> = meshes
        .iter()
        .map(|mesh| {
            let triangles = mesh.groups.iter().map(|group| group.triangles.len() as u64).sum();
            [mesh.positions.len() as u64, triangles, mesh.groups.len() as u64]
        })
        .collect();
    let (mut vertices, mut triangles, mut groups) = (0_u64, 0_u64, 0_u64);
    for object in objects {
        let [mesh_vertices, mesh_triangles, mesh_groups] = sizes[object.mesh as usize];
        groups += mesh_groups;
        vertices += mesh_vertices;
        triangles += mesh_triangles;
    }
    let file = files.whole_scene();
    let limit = u64::from(u32::MAX);
    if vertices >= limit || triangles >= limit {
        return Err(SceneError::file(file, format!("{vertices} vertices and {triangles} triangles are too many"))
            .help(format!("valid: fewer than {limit} of each, with every placed copy counted")));
    }
    let vertex_size = 12
        + if options.needs.normals { 12 } else { 0 }
        + if has.texcoords { 8 } else { 0 }
        + if has.colors { 16 } else { 0 }
        + if has.tangents { 16 } else { 0 };
    budget.take(file, "the placed vertices", vertices * vertex_size)?;
    budget.take(file, "the placed triangles", triangles * 12)?;
    // Each group is listed twice while the list is taken apart.
    budget.take(file, "the placed groups", groups * 2 * size_of::<(Run, Vec<[u32; 3]>)>() as u64)?;
    Ok(vertices as usize)
}

/// By mesh: the first object that places it; messages name that object's file.
fn first_users(meshes: usize, objects: &[Object]) -> Vec<usize> {
    let mut first = vec![0; meshes];
    for (index, object) in objects.iter().enumerate().rev() {
        first[object.mesh as usize] = index;
    }
    first
}

fn ensure_normals(
    meshes: &mut [Mesh],
    first_users: &[usize],
    uses: &[u32],
    files: &FilesOfObjects,
    warnings: &mut Warnings,
) {
    for (index, mesh) in meshes.iter_mut().enumerate().filter(|(index, _)| uses[*index] > 0) {
        let replaced = normals::ensure(mesh);
        if replaced > 0 {
            warnings.add(
                files.of(first_users[index]),
                "meshes with normals that have no direction",
                "computed from the faces",
                || format!("{replaced} in `{}`", mesh.name),
            );
        }
    }
}

fn mend_texcoords(
    meshes: &mut [Mesh],
    first_users: &[usize],
    uses: &[u32],
    files: &FilesOfObjects,
    warnings: &mut Warnings,
) {
    for (index, mesh) in meshes.iter_mut().enumerate().filter(|(index, _)| uses[*index] > 0) {
        if mesh.texcoords.len() != mesh.positions.len() {
            mesh.texcoords = vec![Vec2::ZERO; mesh.positions.len()];
        }
        let bad = mesh.texcoords.par_iter().filter(|texcoord| !texcoord.is_finite()).count();
        if bad > 0 {
            mesh.texcoords.iter_mut().filter(|texcoord| !texcoord.is_finite()).for_each(|t| *t = Vec2::ZERO);
            warnings.add(
                files.of(first_users[index]),
                "meshes with texture coordinates that are not finite",
                "0 serves",
                || format!("{bad} in `{}`", mesh.name),
            );
        }
    }
}

fn mend_colors(
    meshes: &mut [Mesh],
    first_users: &[usize],
    uses: &[u32],
    files: &FilesOfObjects,
    warnings: &mut Warnings,
) {
    const WHAT: &str = "meshes with vertex colours that are not from 0 to 1";
    for (index, mesh) in meshes.iter_mut().enumerate().filter(|(index, _)| uses[*index] > 0) {
        let bad = |color: &&mut Vec4| !(color.cmpge(Vec4::ZERO) & color.cmple(Vec4::ONE)).all();
        let mended = mesh.colors.par_iter_mut().filter(bad);
        let count =
            mended.map(|color| *color = color.map(|c| if c.is_nan() { 1.0 } else { c.clamp(0.0, 1.0) })).count();
        if count > 0 {
            warnings.add(files.of(first_users[index]), WHAT, "the nearest number that is serves, 1 for none", || {
                format!("{count} in `{}`", mesh.name)
            });
        }
    }
}

/// Computes the missing tangents of meshes. `mapped` says by material whether its triangles need tangents.
fn ensure_tangents(
    meshes: &mut [Mesh],
    (first_users, uses): (&[usize], &[u32]),
    mapped: &[bool],
    files: &FilesOfObjects,
    budget: &mut Budget,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    let is_computed = |mesh: &Mesh| tangents::is_mapped(mesh, mapped) && mesh.tangents.len() != mesh.positions.len();
    let triangles = |mesh: &Mesh| mesh.groups.iter().map(|group| group.triangles.len() as u64).sum::<u64>();
    let in_use = || meshes.iter().zip(uses).filter(|(_, uses)| **uses > 0).map(|(mesh, _)| mesh);
    // One mesh per thread is computed at a time; in the worst case these are the largest meshes.
    let mut sizes: Vec<u64> = in_use().filter(|mesh| is_computed(mesh)).map(triangles).collect();
    sizes.sort_unstable_by_key(|size| std::cmp::Reverse(*size));
    let working = sizes.iter().take(rayon::current_num_threads()).sum::<u64>() * tangents::BYTES_PER_TRIANGLE;
    let file = files.whole_scene();
    budget.take(file, "computing tangents", working)?;
    memory::probe(working).map_err(|refused| SceneError::file(file, format!("computing tangents: {refused}")))?;
    let computed: Vec<_> = meshes
        .par_iter_mut()
        .zip(uses)
        .with_max_len(1)
        .map(|(mesh, uses)| (*uses > 0 && tangents::is_mapped(mesh, mapped)).then(|| tangents::ensure(mesh, mapped)))
        .collect();
    budget.give_back(working);
    for (index, result) in computed.into_iter().enumerate() {
        let Some(result) = result else { continue };
        let (file, name) = (files.of(first_users[index]), &meshes[index].name);
        let bare = result.map_err(|what| SceneError::file(file, format!("the tangents of `{name}`: {what}")))?;
        if bare.of_file > 0 {
            let what = "meshes with tangents that have no direction";
            warnings.add(file, what, NO_NORMAL_MAP, || format!("{} in `{name}`", bare.of_file));
        }
        if bare.crowded > 0 {
            let what = "meshes with vertices of more than 1024 triangles, around which no tangent is computed";
            warnings.add(file, what, NO_NORMAL_MAP, || format!("{} in `{name}`", bare.crowded));
        }
    }
    Ok(())
}

/// The list itself, moved out, at its last use; a borrowed view at earlier uses.
fn claim<T: Clone>(list: &mut Vec<T>, last: bool) -> Cow<'_, [T]> {
    if last { Cow::Owned(std::mem::take(list)) } else { Cow::Borrowed(list) }
}

fn append<T: Clone>(target: &mut Vec<T>, source: Cow<'_, [T]>) {
    match source {
        Cow::Owned(list) if target.capacity() == 0 => *target = list,
        list => target.extend_from_slice(&list),
    }
}

/// Appends an attribute of a mesh's vertices, or the default value for each vertex if the mesh lacks the attribute.
fn append_or_fill<T: Clone>(target: &mut Vec<T>, source: &mut Vec<T>, (vertices, missing): (usize, T), last: bool) {
    if source.len() == vertices {
        append(target, claim(source, last));
    } else {
        target.resize(target.len() + vertices, missing);
    }
}

/// Maps `(x, y, z)` to `(x, z, -y)`; columns of the matrix.
const SWAP_YZ: [[f64; 4]; 4] =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// The box that a scene of unit size fills.
fn unit_cube() -> Mesh {
    Mesh { positions: vec![Vec3::NEG_ONE, Vec3::ONE], ..Mesh::default() }
}

/// Applies [`BuildOptions::swap_yz`] to a vector, if it is set.
fn swap(options: &BuildOptions) -> impl Fn(Vec3) -> Vec3 + Sync {
    let swaps = options.swap_yz;
    move |v: Vec3| if swaps { Vec3::new(v.x, v.z, -v.y) } else { v }
}

/// Appends a mesh's vertices in world space. If a combined transform in `f64` is given, it is used for the positions.
fn append_vertices(
    geometry: &mut Geometry,
    mesh: &mut Mesh,
    last: bool,
    (transform, whole): (Mat4, Option<DMat4>),
    options: &BuildOptions,
) {
    let first = geometry.positions.len();
    append(&mut geometry.positions, claim(&mut mesh.positions, last));
    let swap = swap(options);
    if let Some(whole) = whole {
        let place = |position: &mut Vec3| *position = whole.transform_point3(position.as_dvec3()).as_vec3();
        geometry.positions[first..].par_iter_mut().for_each(place);
    } else if transform != Mat4::IDENTITY || options.swap_yz {
        geometry.positions[first..]
            .par_iter_mut()
            .for_each(|position| *position = swap(transform.transform_point3(*position)));
    }
    if options.needs.normals {
        append(&mut geometry.normals, claim(&mut mesh.normals, last));
        let normals = &mut geometry.normals[first..];
        if options.model_space_normals || transform == Mat4::IDENTITY {
            if options.swap_yz {
                normals.par_iter_mut().for_each(|normal| *normal = swap(*normal));
            }
        } else {
            turn(normals, transform, swap);
        }
    }
}

/// Applies [`BuildOptions::transform`] to the whole scene. If `exact`, positions were already placed with this transform, unless
/// the scene was made unit size.
fn place(geometry: &mut Geometry, options: &BuildOptions, exact: bool, origin: DVec3) {
    let transform = options.transform;
    let positions = geometry.positions.par_iter_mut();
    if !exact {
        positions.for_each(|position| *position = transform.transform_point3(*position));
    } else if options.unitize {
        let whole = DMat4::from_translation(-origin) * transform.as_dmat4();
        positions.for_each(|position| *position = whole.transform_point3(position.as_dvec3()).as_vec3());
    }
    if !options.model_space_normals {
        turn(&mut geometry.normals, transform, |normal| normal);
        turn_tangents(&mut geometry.tangents, transform, |tangent| tangent);
    }
}

/// Transforms unit normals, then applies `after`.
fn turn(normals: &mut [Vec3], transform: Mat4, after: impl Fn(Vec3) -> Vec3 + Sync) {
    let matrix = normal_matrix(transform);
    normals.par_iter_mut().for_each(|normal| {
        let turned = normals::unit(matrix * *normal);
        // Only a singular transform leaves no direction. With rank 1 or less, triangles have no area and are dropped; with rank 2, the
        // normal becomes Z.
        *normal = if turned == Vec3::ZERO { Vec3::Z } else { after(turned) };
    });
}

/// Transforms unit tangents, then applies the rotation `after`. A mirroring transform flips the sign of the bitangent, because
/// normals keep their side.
fn turn_tangents(tangents: &mut [Vec4], transform: Mat4, after: impl Fn(Vec3) -> Vec3 + Sync) {
    let side = if transform.determinant() < 0.0 { -1.0 } else { 1.0 };
    let linear = Mat3::from_mat4(transform);
    tangents.par_iter_mut().filter(|tangent| tangent.w != 0.0).for_each(|tangent| {
        let moved =
            if transform == Mat4::IDENTITY { tangent.truncate() } else { normals::unit(linear * tangent.truncate()) };
        *tangent = if moved == Vec3::ZERO { Vec4::ZERO } else { after(moved).extend(tangent.w * side) };
    });
}

/// The inverse transpose of the linear part, up to a positive factor. It is computed as the cofactor matrix, which also exists for
/// singular transforms; the matrix is scaled first so that it neither overflows nor underflows.
fn normal_matrix(transform: Mat4) -> Mat3 {
    let linear = Mat3::from_mat4(transform);
    let largest = linear.x_axis.abs().max(linear.y_axis.abs()).max(linear.z_axis.abs()).max_element();
    if !(largest > 0.0 && largest.is_finite()) {
        return Mat3::IDENTITY;
    }
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis].map(|axis| axis / largest);
    let cofactors = [y.cross(z), z.cross(x), x.cross(y)];
    let sign = if x.dot(cofactors[0]) < 0.0 { -1.0 } else { 1.0 };
    Mat3::from_cols(cofactors[0] * sign, cofactors[1] * sign, cofactors[2] * sign)
}

fn whole(mut lists: Vec<Vec<[u32; 3]>>) -> Vec<[u32; 3]> {
    if lists.len() == 1 {
        return lists.remove(0);
    }
    concatenate(&lists.iter().map(Vec::as_slice).collect::<Vec<_>>())
}

fn verdict(positions: &[Vec3], triangle: &[u32; 3]) -> Verdict {
    if triangle.contains(&BAD) {
        return Verdict::BadIndex;
    }
    let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
    if !(a.is_finite() && b.is_finite() && c.is_finite()) {
        return Verdict::NotFinite;
    }
    let a = a.as_dvec3();
    let twice_area = (b.as_dvec3() - a).cross(c.as_dvec3() - a);
    if large_enough(twice_area) { Verdict::Kept } else { Verdict::Degenerate }
}

fn large_enough(twice_area: DVec3) -> bool {
    twice_area.length() >= f64::from(f32::MIN_POSITIVE)
}

/// Drops the triangles that cannot be drawn, and counts them in warnings.
fn sort_out(
    geometry: &mut Geometry,
    runs: &mut [Run],
    objects: &[Object],
    files: &FilesOfObjects,
    warnings: &mut Warnings,
) {
    let positions = &geometry.positions;
    let verdicts: Vec<Verdict> = geometry.triangles.par_iter().map(|triangle| verdict(positions, triangle)).collect();
    if verdicts.par_iter().all(|verdict| *verdict == Verdict::Kept) {
        return;
    }
    let triangles = &mut geometry.triangles;
    let (mut read, mut write) = (0, 0);
    for run in runs {
        let first_written = write;
        for number in 0..run.triangles {
            let what = match verdicts[read] {
                Verdict::Kept => {
                    triangles[write] = triangles[read];
                    write += 1;
                    None
                }
                Verdict::BadIndex => Some("triangles with vertex indices out of range"),
                Verdict::NotFinite => Some("triangles with corners that are not finite"),
                Verdict::Degenerate => Some("triangles without area"),
            };
            read += 1;
            if let Some(what) = what {
                warnings.add(files.of(run.object), what, "left out", || {
                    format!("triangle {number} in group {} of `{}`", run.group, objects[run.object].name)
                });
            }
        }
        run.triangles = write - first_written;
    }
    triangles.truncate(write);
}

/// Drops the vertices that no triangle uses; the others keep their order.
fn drop_unused_vertices(geometry: &mut Geometry) {
    let mut marks: Vec<AtomicBool> = Vec::new();
    marks.par_extend(geometry.positions.par_iter().map(|_| AtomicBool::new(false)));
    geometry.triangles.par_iter().with_min_len(GRAIN).for_each(|triangle| {
        triangle.iter().for_each(|vertex| marks[*vertex as usize].store(true, Ordering::Relaxed));
    });
    let used: Vec<bool> = marks.into_par_iter().map(AtomicBool::into_inner).collect();
    if used.par_iter().all(|used| *used) {
        return;
    }
    let mut kept = 0;
    let new_index: Vec<u32> = used
        .iter()
        .map(|used| {
            let index = kept;
            kept += u32::from(*used);
            index
        })
        .collect();
    retain(&mut geometry.positions, &used);
    retain(&mut geometry.normals, &used);
    retain(&mut geometry.texcoords, &used);
    retain(&mut geometry.colors, &used);
    retain(&mut geometry.tangents, &used);
    geometry
        .triangles
        .par_iter_mut()
        .for_each(|triangle| *triangle = triangle.map(|vertex| new_index[vertex as usize]));
}

fn retain<T>(list: &mut Vec<T>, used: &[bool]) {
    let mut flags = used.iter();
    list.retain(|_| *flags.next().expect("one flag a vertex"));
}

/// The bounding box of two boxes.
fn around(one: Option<Bounds>, other: Option<Bounds>) -> Option<Bounds> {
    match (one, other) {
        (Some([low, high]), Some([a, b])) => Some([low.min(a), high.max(b)]),
        (one, other) => one.or(other),
    }
}

/// Centres positions and spheres and scales them so that the longest side of their box reaches from -1 to 1. Returns the scale.
fn unitize(positions: &mut [Vec3], balls: &mut [Ball]) -> f32 {
    let low = positions.iter().fold(Vec3::INFINITY, |low, position| low.min(*position)).as_dvec3();
    let high = positions.iter().fold(Vec3::NEG_INFINITY, |high, position| high.max(*position)).as_dvec3();
    let own = (!positions.is_empty()).then_some([low, high]);
    let Some([low, high]) = around(own, spheres::bounds(balls.iter().copied())) else { return 1.0 };
    let center = 0.5 * (low + high);
    let half = 0.5 * (high - low).max_element();
    positions.par_iter_mut().for_each(|position| *position = ((position.as_dvec3() - center) / half).as_vec3());
    balls.iter_mut().for_each(|ball| *ball = ball.fitted(-center, 1.0 / half));
    (1.0 / half) as f32
}

fn batches(runs: &[Run]) -> Vec<Batch> {
    let mut batches: Vec<Batch> = Vec::new();
    let mut first = 0;
    for run in runs.iter().filter(|run| run.triangles > 0) {
        let count = run.triangles as u32;
        match batches.last_mut().filter(|batch| batch.material == run.material) {
            Some(batch) => batch.count += count,
            None => batches.push(Batch { material: run.material, first, count }),
        }
        first += count;
    }
    batches
}
