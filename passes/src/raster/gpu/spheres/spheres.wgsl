// Exact spheres: each is drawn as a rectangle, and its fragments intersect the line of sight with the sphere itself. `record.rs` describes the
// equations. Lines between `//#if NAME` and `//#endif` are only in programs that define NAME; `lights.wgsl` and `camera_planes.wgsl` are part of it.
//
//   COLOR, POSITION, NORMAL, TRIANGLE   attachments that are written
//   LIT                                 light is computed: COLOR or POSITION
//   SURFACE                             the normal is computed: LIT or NORMAL
//   LIGHTS                              several lights, or one with a place, instead of the light of `Frame`

// `SphereRecord`.
struct Sphere {
    at: vec4<f32>,
    right: vec4<f32>,
    down: vec4<f32>,
    ends: vec2<f32>,
    ends_right: vec2<f32>,
    ends_down: vec2<f32>,
    axis: vec2<f32>,
    k: f32,
    scale: f32,
    anchor: vec2<f32>,
    across: vec3<f32>,
    id: u32,
    along: vec3<f32>,
    is_culled: u32,
    towards: vec3<f32>,
    radius: f32,
    center: vec3<f32>,
    bounds: vec4<f32>,
    diffuse: vec4<f32>,
    glow: vec4<f32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> spheres: array<Sphere>;

struct Varyings {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) index: u32,
}

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
    @builtin(frag_depth) depth: f32,
}

// The rectangle that a sphere covers on the screen. Its depth is not that of the sphere, so that the near and far planes do not clip it.
@vertex
fn vertex_main(@builtin(vertex_index) corner: u32, @builtin(instance_index) index: u32) -> Varyings {
    let bounds = spheres[index].bounds;
    let x = select(bounds.x, bounds.z, (corner & 1u) != 0u);
    let y = select(bounds.y, bounds.w, (corner & 2u) != 0u);
    return Varyings(vec4<f32>(x, y, 0.5, 1.0), index);
}

// (a + b) / k where a² - b² = k c. It is also accurate where k is small and a and b nearly cancel.
fn sum_by(a: f32, b: f32, k: f32, c: f32) -> f32 {
    if a * b < 0.0 && abs(k) < 0.5 {
        return c / (a - b);
    }
    // `k` is 0 if the eye is on the sphere. Then one of the two solutions is at infinity: it gets -1, which `depth_of` rejects.
    return select((a + b) / k, -1.0, k == 0.0);
}

// The line of sight through a pixel, in the terms of `record.rs`.
struct Line {
    // Fx, Fy, σ, β.
    numbers: vec4<f32>,
    // Fz, Fw.
    ends: vec2<f32>,
    // ρ².
    square: f32,
    // √(σ² - K ρ²); below 0 where the line passes the sphere.
    root: f32,
}

fn line_through(index: u32, pixel: vec2<f32>) -> Line {
    let off = floor(pixel) - spheres[index].anchor;
    let numbers = fma(
        vec4<f32>(off.x),
        spheres[index].right,
        fma(vec4<f32>(off.y), spheres[index].down, spheres[index].at),
    );
    let ends = fma(
        vec2<f32>(off.x),
        spheres[index].ends_right,
        fma(vec2<f32>(off.y), spheres[index].ends_down, spheres[index].ends),
    );
    let square = dot(numbers.xy, numbers.xy);
    let discriminant = fma(numbers.z, numbers.z, -spheres[index].k * square);
    return Line(numbers, ends, square, select(-1.0, sqrt(max(discriminant, 0.0)), discriminant >= 0.0));
}

// The depth at which a line hits the outer side (root above 0) or the inner side; below 0 if the hit is outside the near and far planes.
fn depth_of(index: u32, line: Line, root: f32) -> f32 {
    let k = spheres[index].k;
    let axis = spheres[index].axis;
    let far = (line.ends.x - line.ends.y) * (line.ends.x + line.ends.y) + line.square;
    let depth = sum_by(line.numbers.w, root, k, far) * spheres[index].scale;
    // The fourth coordinate, which is below 0 behind the eye.
    let sigma = line.numbers.z;
    let w = sum_by(axis.x * sigma, axis.y * root, k, fma(sigma, sigma, axis.y * axis.y * line.square));
    return select(-1.0, depth, depth >= 0.0 && depth <= 1.0 && w > 0.0);
}

fn normal_of(index: u32, line: Line, root: f32) -> vec3<f32> {
    let axis = spheres[index].axis;
    let sigma = line.numbers.z;
    let z = sum_by(axis.y * sigma, axis.x * root, spheres[index].k, fma(axis.x * axis.x, line.square, -sigma * sigma));
    let own = vec3<f32>(line.numbers.xy, z);
    let world = own.x * spheres[index].across + own.y * spheres[index].along + own.z * spheres[index].towards;
    return world / length(own);
}

@fragment
fn fragment_main(in: Varyings) -> Pixel {
    let index = in.index;
    let line = line_through(index, in.clip.xy);
    if line.root < 0.0 {
        discard;
    }
    var root = line.root;
    var depth = depth_of(index, line, root);
    if depth < 0.0 && spheres[index].is_culled == 0u {
        root = -root;
        depth = depth_of(index, line, root);
    }
    if depth < 0.0 {
        discard;
    }
    var out: Pixel;
    // Pixels without a surface have depth 0.
    out.depth = max(depth, 1e-37);
//#if SURFACE
    let normal = normal_of(index, line, root);
//#endif
//#if LIT
    let position = fma(vec3<f32>(spheres[index].radius), normal, spheres[index].center);
//#if LIGHTS
    let arrived = sum_of_lights(position, normal, normal);
    let cosine = arrived.w;
//#else
    let cosine = clamp(dot(frame.to_light.xyz, normal), 0.0, 1.0);
    let arrived = frame.light_color * cosine;
//#endif
//#endif
//#if COLOR
    let diffuse = spheres[index].diffuse;
    out.color = 0.3 * diffuse + diffuse * arrived + spheres[index].glow;
//#endif
//#if POSITION
    out.position = vec4<f32>(position, cosine);
//#endif
//#if NORMAL
    out.normal = vec4<f32>(normal, 0.0);
//#endif
//#if TRIANGLE
    out.triangle = spheres[index].id;
//#endif
    return out;
}
