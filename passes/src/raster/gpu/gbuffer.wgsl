// The G-buffer program: one text for all variants. Lines between `//#if NAME` and `//#endif` (with an optional
// `//#else`) are only in variants that define NAME; see `shader.rs`. `lights.wgsl` and `camera_planes.wgsl` are part of it.
//
//   COLOR, POSITION, NORMAL, TRIANGLE   attachments that are written
//   VERTEX_NORMAL                       the vertices carry normals, and COLOR, POSITION or NORMAL reads them
//   TEXTURED                            the material has a texture, and COLOR or ALPHA_CUT reads it
//   WRITES                              any attachment is written; without it, only the depth is
//   TEXCOORD                            the vertices carry texture coordinates: TEXTURED, GLOW_TEXTURED or BENT
//   GLOW, GLOW_TEXTURED                 the material emits light; a texture multiplies the emitted light
//   BENT                                a normal map bends the normals; the vertices carry tangents
//   WORLD                               the place in the world is interpolated: POSITION, BENT or LIGHTS
//   WRAPPED                             the samplers wrap texture coordinates; without it, all textures repeat
//   VERTEX_COLOR                        the vertices carry colours, and COLOR or ALPHA_CUT reads them
//   ALPHA_CUT                           where alpha is below the material's cutoff there is no surface
//   LIGHTS                              several lights, or one with a place, instead of the light of `Frame`
//   SKY                                 all attachments but the colour are written as 0
//   MIRRORED                            seen by a mirrored camera: fragments behind the mirror are discarded
//   PLANE_DEPTH                         depth is that of the triangle's plane, not the device's
//   EARLY                               the device drops hidden fragments by its own depth, which a bias makes nearer
//   PRIMITIVE                           the fragment's triangle within its draw is known: for TRIANGLE or PLANE_DEPTH
//   PER_PIXEL                           a compute program, which shades each pixel once, from the visibility buffer: the ids of the
//                                       triangles that are seen; cuts, mirrors and depth were decided when the ids were drawn
//   LEAVES                              WRITES or PLANE_DEPTH
//#if PRIMITIVE
enable primitive_index;
//#endif

// Uniforms of a draw: triangles of one material.
struct Draw {
    diffuse: vec4<f32>,
    emission: vec4<f32>,
    // Emitted light; alpha is 0.
    glow: vec4<f32>,
    // Id of the draw's first triangle, plus 1: the attachment is cleared to 0, which therefore means "no triangle".
    first_triangle: u32,
    alpha_cutoff: f32,
    // Factor of x and y of the normal map.
    normal_scale: f32,
    // Index of the draw's first triangle among the triangles of its chunk.
    first_of_chunk: u32,
    // Number of triangles of the draw.
    count: u32,
    // PER_PIXEL: whether pixels without a triangle are written, not 0 in one draw of a pass.
    clears: u32,
    // PER_PIXEL: the upper left corner of the rectangle of pixels that the draw's triangles can cover, relative to the corner of the part
    // (`frame.part`).
    corner: vec2<u32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> draw: Draw;
//#if PLANE_DEPTH

// The planes of the chunk's triangles, which `planes.wgsl` computes.
@group(0) @binding(3) var<storage, read> planes: array<Plane>;
//#endif
//#if PER_PIXEL

// Ids, plus 1, of the visible triangles.
@group(0) @binding(3) var visible: texture_2d<u32>;
// Three indices of vertices for each triangle of the chunk.
@group(0) @binding(4) var<storage, read> corners: array<u32>;
@group(0) @binding(5) var<storage, read> positions: array<f32>;
@group(0) @binding(6) var<storage, read> normals: array<f32>;
@group(0) @binding(7) var<storage, read> texcoords: array<vec2<f32>>;
@group(0) @binding(8) var<storage, read> colors: array<vec4<f32>>;
@group(0) @binding(9) var<storage, read> tangents: array<vec4<f32>>;
// The attachments. `pipelines.rs` inserts their formats.
//#if COLOR
@group(0) @binding(10) var color_attachment: texture_storage_2d<COLOR_FORMAT, write>;
//#endif
//#if POSITION
@group(0) @binding(11) var position_attachment: texture_storage_2d<POSITION_FORMAT, write>;
//#endif
//#if NORMAL
@group(0) @binding(12) var normal_attachment: texture_storage_2d<NORMAL_FORMAT, write>;
//#endif
//#if TRIANGLE
@group(0) @binding(13) var triangle_attachment: texture_storage_2d<r32uint, write>;
//#endif
//#endif
//#if TEXTURED
@group(1) @binding(0) var material_texture: texture_2d<f32>;
@group(1) @binding(1) var trilinear: sampler;
//#endif
//#if GLOW_TEXTURED
@group(2) @binding(0) var glow_texture: texture_2d<f32>;
@group(2) @binding(1) var glow_trilinear: sampler;
//#endif

//#if BENT
@group(3) @binding(0) var normal_texture: texture_2d<f32>;
@group(3) @binding(1) var normal_trilinear: sampler;
//#endif

//#if PER_PIXEL
//#else
struct Vertex {
    @location(0) position: vec3<f32>,
//#if VERTEX_NORMAL
    @location(1) normal: vec3<f32>,
//#endif
//#if TEXCOORD
    @location(2) texcoord: vec2<f32>,
//#endif
//#if VERTEX_COLOR
    @location(3) color: vec4<f32>,
//#endif
//#if BENT
    @location(4) tangent: vec4<f32>,
//#endif
}
//#endif

struct Varyings {
    // Invariant: neighbouring materials use different variants, and their shared edges must coincide.
    @builtin(position) @invariant clip: vec4<f32>,
//#if WORLD
    @location(0) world: vec3<f32>,
//#endif
//#if VERTEX_NORMAL
    @location(1) normal: vec3<f32>,
//#endif
//#if TEXCOORD
    @location(2) texcoord: vec2<f32>,
//#endif
//#if VERTEX_COLOR
    @location(3) color: vec4<f32>,
//#endif
//#if BENT
    @location(4) tangent: vec4<f32>,
//#endif
//#if MIRRORED
    @location(5) above: f32,
//#endif
}

//#if LEAVES
struct Pixel {
//#if COLOR
    @location(0) color: vec4<f32>,
//#endif
//#if POSITION
    @location(1) position: vec4<f32>,
//#endif
//#if NORMAL
    @location(2) normal: vec4<f32>,
//#endif
//#if TRIANGLE
    @location(3) triangle: u32,
//#endif
//#if PLANE_DEPTH
    @builtin(frag_depth) depth: f32,
//#endif
}
//#endif

//#if PER_PIXEL
//#if TEXCOORD
// Changes of the texture coordinates to the neighbouring pixels of the same square of four pixels, across and down.
var<private> across: vec2<f32>;
var<private> down: vec2<f32>;
//#endif
//#if BENT
// A normal of the triangle, of any length and on either side.
var<private> of_plane: vec3<f32>;
//#endif
//#else
@vertex
fn vertex_main(vertex: Vertex) -> Varyings {
    var out: Varyings;
    out.clip = frame.clip_from_eye * vec4<f32>(vertex.position - frame.eye.xyz, 1.0);
//#if MIRRORED
    out.above = dot(frame.clip_plane, vec4<f32>(vertex.position - frame.eye.xyz, 1.0));
//#endif
//#if WORLD
    out.world = vertex.position;
//#endif
//#if VERTEX_NORMAL
    out.normal = vertex.normal;
//#endif
//#if TEXCOORD
    out.texcoord = vertex.texcoord;
//#endif
//#if VERTEX_COLOR
    out.color = vertex.color;
//#endif
//#if BENT
    out.tangent = vertex.tangent;
//#endif
    return out;
}
//#endif

//#if TEXCOORD
// `log2` of the footprint's longer side in texels of level 0 (Vulkan 1.3, section 16.5.7), for a texture of `size`
// texels; 0 where that side is below 1.
fn level_of_detail(texcoord: vec2<f32>, size: vec2<f32>) -> f32 {
//#if PER_PIXEL
    let along_x = across * size * frame.eye.w;
    let along_y = down * size * frame.eye.w;
//#else
    let along_x = dpdxFine(texcoord) * size * frame.eye.w;
    let along_y = dpdyFine(texcoord) * size * frame.eye.w;
//#endif
    let footprint = max(dot(along_x, along_x), dot(along_y, along_y));
    return select(0.0, 0.5 * log2(footprint), footprint > 1.0);
}
//#endif

//#if TEXTURED
// The texture at `texcoord`, where v = 0 is the bottom row. The level is computed here and not by the driver, so that
// every device uses the same. The fractional part is taken first, because large coordinates would lose the sub-texel
// position.
fn sample_texture(texcoord: vec2<f32>, level: f32) -> vec4<f32> {
//#if WRAPPED
    let wrapped = texcoord;
//#else
    let wrapped = fract(texcoord);
//#endif
    return textureSampleLevel(material_texture, trilinear, vec2<f32>(wrapped.x, 1.0 - wrapped.y), level);
}
//#endif

//#if GLOW_TEXTURED
fn sample_glow(texcoord: vec2<f32>) -> vec4<f32> {
    let level = level_of_detail(texcoord, vec2<f32>(textureDimensions(glow_texture, 0)));
//#if WRAPPED
    let wrapped = texcoord;
//#else
    let wrapped = fract(texcoord);
//#endif
    return textureSampleLevel(glow_texture, glow_trilinear, vec2<f32>(wrapped.x, 1.0 - wrapped.y), level);
}
//#endif

//#if BENT
fn sample_normals(texcoord: vec2<f32>) -> vec3<f32> {
    let level = level_of_detail(texcoord, vec2<f32>(textureDimensions(normal_texture, 0)));
//#if WRAPPED
    let wrapped = texcoord;
//#else
    let wrapped = fract(texcoord);
//#endif
    return textureSampleLevel(normal_texture, normal_trilinear, vec2<f32>(wrapped.x, 1.0 - wrapped.y), level).rgb;
}

fn unit_or(vector: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let length_squared = dot(vector, vector);
    return select(normalize(other), vector * inverseSqrt(length_squared), length_squared > 0.0);
}

// The interpolated normal, bent by a texel of the normal map, on a triangle of unit normal `flat_normal`: as
// `normal_map::bent` of the pipeline.
fn bent(texel: vec3<f32>, normal: vec3<f32>, tangent: vec4<f32>, flat_normal: vec3<f32>) -> vec3<f32> {
    let slopes = (2.0 * texel.xy - 1.0) * draw.normal_scale;
    let height = max(2.0 * texel.z - 1.0, 1.0 / 255.0);
    let across = cross(normal, tangent.xyz) * tangent.w;
    let turned = unit_or(tangent.xyz * slopes.x + across * slopes.y + normal * height, normal);
    let side = select(flat_normal, -flat_normal, dot(flat_normal, normal) < 0.0);
    let cosine = dot(turned, side);
    if cosine < 0.01 {
        return unit_or(turned + side * (0.01 - cosine), side);
    }
    return turned;
}
//#endif

//#if PLANE_DEPTH
// Depth at a pixel in the plane through the triangle's exact corners. The device interpolates between corners that it snapped to fractions of a
// pixel, on a plane of another slope. `pixel` is the fragment's built-in position.
//
//#if EARLY
// The device's depth is made nearer by a bias (`DEPTH_BIAS`), so that no written depth is nearer. The device can then drop fragments of hidden
// surfaces before they are shaded.
//
//#endif
// The device's depth is kept in two cases. In the first, the slopes of the two planes differ by more than half: snapping must have changed the
// triangle's shape, as that of a sliver. In the second, the depths differ by more than an eighth of a pixel changes them: depth has no accurate
// value there, as for planes seen edge-on. Both limits allow for rounding. A comparison with NaN also keeps the device's depth.
fn plane_depth(primitive: u32, pixel: vec4<f32>) -> f32 {
    let snapped_slope = vec2<f32>(dpdx(pixel.z), dpdy(pixel.z));
    let own = planes[draw.first_of_chunk + primitive];
    let line = fma(vec4<f32>(pixel.x), frame.right, fma(vec4<f32>(pixel.y), frame.down, frame.corner));
    let depth = product(own.plane, line) * own.scale;
    let steepness = abs(own.slope.x) + abs(own.slope.y);
    let leaning = abs(own.slope - snapped_slope);
    let is_alike = leaning.x + leaning.y < 0.5 * steepness + pixel.z * 1e-6;
//#if EARLY
    let snapped_depth = pixel.z - 0.0625 * max(abs(snapped_slope.x), abs(snapped_slope.y));
//#else
    let snapped_depth = pixel.z;
//#endif
    let is_near = abs(depth - snapped_depth) < 0.125 * steepness + pixel.z * 1e-5;
//#if EARLY
    return min(select(snapped_depth, depth, is_alike && is_near), pixel.z);
//#else
    return select(snapped_depth, depth, is_alike && is_near);
//#endif
}
//#endif

//#if PER_PIXEL
// The attachments' values at a pixel that shows a triangle of the draw.
fn shaded(in: Varyings, primitive: u32) -> Pixel {
//#else
@fragment
//#if EARLY
@early_depth_test(less_equal)
//#endif
fn fragment_main(
    in: Varyings,
//#if PRIMITIVE
    @builtin(primitive_index) primitive: u32,
//#endif
//#if LEAVES
) -> Pixel {
//#else
) {
//#endif
//#endif
//#if PLANE_DEPTH
    let depth = plane_depth(primitive, in.clip);
//#endif
//#if GLOW_TEXTURED
    let shining = sample_glow(in.texcoord).rgb;
//#endif
//#if BENT
    let normal_texel = sample_normals(in.texcoord);
    // The triangle's own normal, on either side.
//#if PER_PIXEL
    let flat_normal = unit_or(of_plane, in.normal);
//#else
    let flat_normal = unit_or(cross(unit_or(dpdxFine(in.world), in.normal), unit_or(dpdyFine(in.world), in.normal)), in.normal);
//#endif
//#endif
//#if TEXTURED
//#if COLOR
    let size = vec2<f32>(textureDimensions(material_texture, 0));
    let texel = sample_texture(in.texcoord, level_of_detail(in.texcoord, size));
//#endif
//#endif
//#if MIRRORED
    if in.above < 0.0 {
        discard;
    }
//#endif
//#if ALPHA_CUT
    var alpha = 1.0;
//#if TEXTURED
    // Level 0, as for rays, so that light passes where the camera sees through.
    alpha = sample_texture(in.texcoord, 0.0).a;
//#endif
//#if VERTEX_COLOR
    alpha *= in.color.a;
//#endif
    if alpha < draw.alpha_cutoff {
        discard;
    }
//#endif
//#if WRITES
    var normal = vec3<f32>(0.0);
    var cosine = 0.0;
//#if VERTEX_NORMAL
    let length_squared = dot(in.normal, in.normal);
    // Normals of opposite direction may cancel, as in the rasteriser on the processor.
    if length_squared > 1e-30 {
        normal = in.normal / sqrt(length_squared);
    }
    cosine = clamp(dot(frame.to_light.xyz, normal), 0.0, 1.0);
//#endif
//#if BENT
    if length_squared > 1e-30 {
        normal = bent(normal_texel, in.normal, in.tangent, flat_normal);
        // There is no light below the horizon of the unbent surface, even where the bent normal faces it.
        let lit = dot(frame.to_light.xyz, in.normal) > 0.0;
        cosine = select(0.0, clamp(dot(frame.to_light.xyz, normal), 0.0, 1.0), lit);
    }
//#endif
//#if LIGHTS
    let arrived = sum_of_lights(in.world, normal, in.normal);
    cosine = arrived.w;
//#endif
//#endif
//#if LEAVES
    var out: Pixel;
//#endif
//#if PLANE_DEPTH
    out.depth = depth;
//#endif
//#if WRITES
//#if COLOR
//#if LIGHTS
    let lit = draw.diffuse * arrived;
//#else
    let lit = draw.diffuse * frame.light_color * cosine;
//#endif
//#if TEXTURED
    out.color = (lit + draw.emission + 0.3) * texel;
//#else
    out.color = lit + 0.3 * draw.diffuse;
//#endif
//#if VERTEX_COLOR
    out.color *= in.color;
//#endif
//#if GLOW
//#if GLOW_TEXTURED
    out.color += vec4<f32>(draw.glow.rgb * shining, 0.0);
//#else
    out.color += draw.glow;
//#endif
//#endif
//#endif
//#if SKY
//#if POSITION
    out.position = vec4<f32>(0.0);
//#endif
//#if NORMAL
    out.normal = vec4<f32>(0.0);
//#endif
//#if TRIANGLE
    out.triangle = 0u;
//#endif
//#else
//#if POSITION
    out.position = vec4<f32>(in.world, cosine);
//#endif
//#if NORMAL
    out.normal = vec4<f32>(normal, 0.0);
//#endif
//#if TRIANGLE
    out.triangle = draw.first_triangle + primitive;
//#endif
//#endif
//#endif
//#if LEAVES
    return out;
//#endif
}
//#if PER_PIXEL

fn position_of(vertex: u32) -> vec3<f32> {
    return vec3<f32>(positions[3u * vertex], positions[3u * vertex + 1u], positions[3u * vertex + 2u]);
}
//#if VERTEX_NORMAL

fn normal_of(vertex: u32) -> vec3<f32> {
    return vec3<f32>(normals[3u * vertex], normals[3u * vertex + 1u], normals[3u * vertex + 2u]);
}
//#endif

// `a.x * b.y - a.y * b.x`, off by less than two units in the last place (Kahan): where a triangle is narrow, the products cancel.
fn determinant_of(a: vec2<f32>, b: vec2<f32>) -> f32 {
    let product = a.y * b.x;
    return fma(a.x, b.y, -product) + fma(-a.y, b.x, product);
}

// The corners relative to a place in normalised device coordinates, each times its w.
fn around(place: vec2<f32>, corner: array<vec3<f32>, 3>) -> array<vec2<f32>, 3> {
    return array<vec2<f32>, 3>(
        fma(-place, vec2<f32>(corner[0].z), corner[0].xy),
        fma(-place, vec2<f32>(corner[1].z), corner[1].xy),
        fma(-place, vec2<f32>(corner[2].z), corner[2].xy),
    );
}

// The doubled areas opposite to the corners, which the barycentric coordinates are proportional to.
fn areas_of(way: array<vec2<f32>, 3>) -> vec3<f32> {
    return vec3<f32>(determinant_of(way[1], way[2]), determinant_of(way[2], way[0]), determinant_of(way[0], way[1]));
}

// Barycentric coordinates of the point of a triangle that is seen at `place`, in normalised device coordinates. The corners are in clip
// coordinates and not snapped. They may be behind the eye: this is the rule of Olano and Greer, "Triangle scan conversion using 2D homogeneous
// coordinates" (1997), relative to the pixel.
fn shares(place: vec2<f32>, corner: array<vec3<f32>, 3>) -> vec3<f32> {
    let areas = areas_of(around(place, corner));
    return areas / (areas.x + areas.y + areas.z);
}

// The point of an edge that is nearest to a pixel on the screen: its place along the edge, from 0 to 1, and its distance from the pixel, in
// pixels. `from_` and `to_` are the vectors from the pixel to the edge's ends, in pixels.
fn nearest_on_edge(from_: vec2<f32>, to_: vec2<f32>) -> vec2<f32> {
    let along = to_ - from_;
    let squared = dot(along, along);
    // An edge of length 0 has a single point.
    let at = select(0.0, clamp(-dot(from_, along) / squared, 0.0, 1.0), squared > 0.0);
    return vec2<f32>(at, length(fma(along, vec2<f32>(at), from_)));
}

// Barycentric coordinates of the point of a triangle's border that is nearest to a pixel on the screen, and its distance in pixels. The corners
// are in front of the eye; `ways` are the vectors from the pixel to them, in pixels.
fn nearest_on_border(ways: array<vec2<f32>, 3>, w: vec3<f32>) -> vec4<f32> {
    let a = nearest_on_edge(ways[0], ways[1]);
    let b = nearest_on_edge(ways[1], ways[2]);
    let c = nearest_on_edge(ways[2], ways[0]);
    // `a.x`, `b.x` and `c.x` are places along the edges on the screen; the barycentric coordinates are those in space.
    var found = vec3<f32>((1.0 - a.x) * w.y, a.x * w.x, 0.0);
    var least = a.y;
    if b.y < least {
        found = vec3<f32>(0.0, (1.0 - b.x) * w.z, b.x * w.y);
        least = b.y;
    }
    if c.y < least {
        found = vec3<f32>(c.x * w.z, 0.0, (1.0 - c.x) * w.x);
        least = c.y;
    }
    return vec4<f32>(found / (found.x + found.y + found.z), least);
}

// Barycentric coordinates of the point that a pixel shows of a triangle. `exact` are those of the pixel's centre in the triangle's plane.
//
// Where a triangle is narrow, rounding of the barycentric coordinates moves their point along the triangle. The distance of this point from the
// pixel is known more precisely than the coordinates, which are corrected by it. A pixel that is covered only because the corners were snapped
// lies outside of the triangle, and shows the nearest point of it. The same holds if the coordinates consist of rounding alone, as for a triangle
// without width.
fn shown(exact: vec3<f32>, place: vec2<f32>, pixel_size: vec2<f32>, corner: array<vec3<f32>, 3>) -> vec3<f32> {
    let w = vec3<f32>(corner[0].z, corner[1].z, corner[2].z);
    let ways = around(place, corner);
    let a = ways[0];
    let b = ways[1];
    let c = ways[2];
    let off = (a * exact.x + b * exact.y + c * exact.z) / dot(w, exact);
    if all(exact >= vec3<f32>(0.0)) && all(abs(off / pixel_size) < vec2<f32>(1.0 / 4096.0)) {
        return exact;
    }
    // The areas that the barycentric coordinates are made of, and the changes of these areas if `place` moves by `off`.
    let areas = areas_of(ways);
    let changes = vec3<f32>(
        dot(off, vec2<f32>(w.z * b.y - w.y * c.y, w.y * c.x - w.z * b.x)),
        dot(off, vec2<f32>(w.x * c.y - w.z * a.y, w.z * a.x - w.x * c.x)),
        dot(off, vec2<f32>(w.y * a.y - w.x * b.y, w.x * b.x - w.y * a.x)),
    );
    let mended_areas = areas - changes;
    let mended = mended_areas / (mended_areas.x + mended_areas.y + mended_areas.z);
    let is_inside = all(mended >= vec3<f32>(0.0));
    let distance = length((a * mended.x + b * mended.y + c * mended.z) / dot(w, mended) / pixel_size);
    if all(w > vec3<f32>(0.0)) {
        let border = nearest_on_border(array<vec2<f32>, 3>(a / w.x / pixel_size, b / w.y / pixel_size, c / w.z / pixel_size), w);
        if is_inside && distance <= border.w {
            return mended;
        }
        return border.xyz;
    }
    // Where a corner is behind the eye, some nearby point is used.
    let inside = max(exact, vec3<f32>(0.0));
    let sum = inside.x + inside.y + inside.z;
    return select(vec3<f32>(1.0, 0.0, 0.0), inside / sum, sum > 0.0);
}

fn clip_of(position: vec3<f32>) -> vec3<f32> {
    return (frame.clip_from_eye * vec4<f32>(position - frame.eye.xyz, 1.0)).xyw;
}

fn store(pixel: vec2<u32>, out: Pixel) {
//#if COLOR
    textureStore(color_attachment, pixel, out.color);
//#endif
//#if POSITION
    textureStore(position_attachment, pixel, out.position);
//#endif
//#if NORMAL
    textureStore(normal_attachment, pixel, out.normal);
//#endif
//#if TRIANGLE
    textureStore(triangle_attachment, pixel, vec4<u32>(out.triangle));
//#endif
}

fn shade(pixel: vec2<u32>) {
    let seen = textureLoad(visible, pixel, 0).x;
    if seen == 0u && draw.clears != 0u {
        var nothing: Pixel;
//#if COLOR
        nothing.color = frame.background;
//#endif
        store(pixel, nothing);
    }
    // Without a triangle, this is greater than any triangle's number.
    let primitive = seen - draw.first_triangle;
    if primitive >= draw.count {
        return;
    }
    let first = 3u * (draw.first_of_chunk + primitive);
    let vertex = array<u32, 3>(corners[first], corners[first + 1u], corners[first + 2u]);
    let position = array<vec3<f32>, 3>(position_of(vertex[0]), position_of(vertex[1]), position_of(vertex[2]));
    let corner = array<vec3<f32>, 3>(clip_of(position[0]), clip_of(position[1]), clip_of(position[2]));
    // A pixel's size. The second coordinate points up.
    let pixel_size = vec2<f32>(2.0, -2.0) / vec2<f32>(textureDimensions(visible));
    let place = fma(vec2<f32>(pixel) + 0.5, pixel_size, vec2<f32>(-1.0, 1.0));
    let exact = shares(place, corner);
    let share = shown(exact, place, pixel_size, corner).yz;
    var in: Varyings;
//#if WORLD
    in.world = fma(vec3<f32>(share.x), position[1] - position[0], fma(vec3<f32>(share.y), position[2] - position[0], position[0]));
//#endif
//#if VERTEX_NORMAL
    let normal = array<vec3<f32>, 3>(normal_of(vertex[0]), normal_of(vertex[1]), normal_of(vertex[2]));
    in.normal = fma(vec3<f32>(share.x), normal[1] - normal[0], fma(vec3<f32>(share.y), normal[2] - normal[0], normal[0]));
//#endif
//#if TEXCOORD
    let texcoord = texcoords[vertex[0]];
    let edges = mat2x2<f32>(texcoords[vertex[1]] - texcoord, texcoords[vertex[2]] - texcoord);
    in.texcoord = fma(vec2<f32>(share.x), edges[0], fma(vec2<f32>(share.y), edges[1], texcoord));
    // The differences are taken to the same pixels as by a device's derivatives.
    let side = 1.0 - 2.0 * vec2<f32>(pixel & vec2<u32>(1u));
    across = edges * (side.x * (shares(place + vec2<f32>(side.x * pixel_size.x, 0.0), corner) - exact).yz);
    down = edges * (side.y * (shares(place + vec2<f32>(0.0, side.y * pixel_size.y), corner) - exact).yz);
//#endif
//#if VERTEX_COLOR
    let color = colors[vertex[0]];
    in.color = fma(
        vec4<f32>(share.x),
        colors[vertex[1]] - color,
        fma(vec4<f32>(share.y), colors[vertex[2]] - color, color),
    );
//#endif
//#if BENT
    let tangent = tangents[vertex[0]];
    in.tangent = fma(
        vec4<f32>(share.x),
        tangents[vertex[1]] - tangent,
        fma(vec4<f32>(share.y), tangents[vertex[2]] - tangent, tangent),
    );
    of_plane = cross(position[1] - position[0], position[2] - position[0]);
//#endif
    store(pixel, shaded(in, primitive));
}

@compute @workgroup_size(16, 16)
fn pixel_main(@builtin(global_invocation_id) place: vec3<u32>) {
    let pixel = draw.corner + place.xy;
    if pixel.x < frame.part.z && pixel.y < frame.part.w {
        shade(frame.part.xy + pixel);
    }
}
//#endif
