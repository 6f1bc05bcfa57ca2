// Points of surfaces whose light and occlusion are found by successive kernels: first the points that pixels see, in the order of the
// tiles, then those seen through glass.

// Six vectors for each point. For a pixel that shows glass, the first point has no colour and only refers to the next.
//   0: ray origin, without the offset from the surface; w: that offset, negative where the surface is turned from the light
//   1: the side to the viewer; w: the key of its random numbers
//   2: the shading normal; w: its weight in the pixel's sum
//   3: its colour; w: the next point of the pixel, or NONE
//   4: for a side that is turned from the light, the vector by which it is lifted; w: -1 where that side is not the viewer's, else 1.
//      Later, with up to 128 occlusion rays, one bit for each ray that is still to be traced
//   5: number of rays known to be open; the distance before which nothing stops the remaining rays; the node that contains everything
//      that they may hit, or NONE where no ray remains
// Where glass focuses light, vectors 4 and 5 hold what `list_focused.wgsl` says until `final_focus.wgsl` has run.
@group(0) @binding(7) var<storage, read_write> points: array<vec4u>;
const POINT: u32 = 6u;
// Value for a pixel whose points did not fit: one thread computes the pixel from beginning to end.
const NO_ROOM: u32 = 0xfffffffeu;

fn point_vector(point: u32, place: u32) -> vec4f { return bitcast<vec4f>(points[POINT * point + place]); }
fn color_of(point: u32) -> vec3f { return point_vector(point, 3u).xyz; }
fn next_of(point: u32) -> u32 { return points[POINT * point + 3u].w; }
// A point for a pixel that has no surface of its own.
fn put_nothing(point: u32, next: u32) { points[POINT * point + 3u] = vec4u(0u, 0u, 0u, next); }
// For such a pixel, the colour that the background adds to it. In a sample, the last word has the stochastic events of its path.
fn put_missed(point: u32, color: vec3f) { points[POINT * point + 2u] = vec4u(bitcast<vec3u>(color), 0u); }
fn missed_of(point: u32) -> vec3f { return point_vector(point, 2u).xyz; }
fn put_point(point: u32, surface: Surface, turned: bool, key: u32, weight: f32, color: vec3f) {
    let step = OFFSET_UNITS * surface.point.error;
    points[POINT * point] = bitcast<vec4u>(vec4f(surface.point.start, select(step, -step, turned)));
    points[POINT * point + 1u] = vec4u(bitcast<vec3u>(surface.facing), key);
    points[POINT * point + 2u] = bitcast<vec4u>(vec4f(surface.normal, weight));
    points[POINT * point + 3u] = vec4u(bitcast<vec3u>(color), NONE);
    // Nothing is known about its rays yet.
    points[POINT * point + 5u] = vec4u(0u, 0u, params.root, 0u);
}
// Index of the word behind the ray counts, which counts the points of a launch.
const FOUND: u32 = 2u * RAY_COUNT_KINDS * RAY_COUNT_SLOTS;
fn points_found() -> u32 { return min(atomicLoad(&ray_counts[FOUND]), params.capacity); }
fn slot_of(pixel: Pixel) -> u32 {
    let tile = pixel.y / TILE * params.tiles_across + pixel.x / TILE;
    return (tile - params.first_tile) * TILE * TILE + pixel.y % TILE * TILE + pixel.x % TILE;
}
