// A pixel of a pass, its stored attributes, and its ray counts.

struct Pixel { x: u32, y: u32 }

// Ray counts by kind: shadow, occlusion, reflected, refracted, certain occlusion rays, and paths lost in glass.
var<private> rays: array<u32, RAY_COUNT_KINDS>;
const SHADOW: u32 = 0u;
const OCCLUSION: u32 = 1u;
const REFLECTED: u32 = 2u;
const REFRACTED: u32 = 3u;
const CERTAIN: u32 = 4u;
const LOST: u32 = 5u;
fn count(kind: u32) { rays[kind] += 1u; }

fn stored_color(pixel: Pixel) -> vec4f { return textureLoad(color_buffer, vec2u(pixel.x, pixel.y), 0); }
fn stored_position(pixel: Pixel) -> vec4f { return textureLoad(position_buffer, vec2u(pixel.x, pixel.y), 0); }
fn stored_normal(pixel: Pixel) -> vec3f { return textureLoad(normal_buffer, vec2u(pixel.x, pixel.y), 0).xyz; }
fn stored_triangle(pixel: Pixel) -> u32 {
    return textureLoad(triangle_buffer, vec2u(pixel.x, pixel.y), 0).x - params.id_base;
}

// The nearest surface from an origin that is offset from its own surface.
fn closest_surface(origin: vec3f, direction: vec3f, hit: ptr<function, Hit>) -> bool {
    return closest(ACCEPT_COVERED, Ray(origin, direction, 0.0, HUGE), hit);
}
// Whether light reaches a position. A ray that is not finite hits nothing.
fn thesis_sees_light(accept: u32, position: vec3f) -> bool {
    return !occluded(accept, Ray(position, params.to_light, THESIS_EPSILON, HUGE));
}

// Whether an occluder blocks the segment from a triangle (`start`) to the lifted point, which is `way` away.
fn is_cut_off(accept: u32, start: vec3f, way: vec3f) -> bool {
    count(SHADOW);
    let length = sep(sqrt(dot3(way, way)));
    return occluded(accept, Ray(start, sep3(way * sep(1.0 / length)), 0.0, length));
}

fn opaque(color: vec3f) -> vec4f { return vec4f(color, 1.0); }

// Adds a pixel's rays to the sums, which are spread over slots so that atomic additions rarely collide.
fn count_rays(tile: u32) {
    let slot = 2u * RAY_COUNT_KINDS * (tile % RAY_COUNT_SLOTS);
    for (var kind = 0u; kind < RAY_COUNT_KINDS; kind += 1u) {
        let more = rays[kind];
        if more == 0u { continue; }
        let before = atomicAdd(&ray_counts[slot + 2u * kind], more);
        if before + more < before { atomicAdd(&ray_counts[slot + 2u * kind + 1u], 1u); }
    }
}
