// Reflection and refraction in glass from cube maps: `raster::effects::cube` and `raster::effects::panes`.
//
//   REFRACT   also shows what is behind the pane

struct Params {
    eye: vec4<f32>,
    // For each face: the directions to its centre, to its right, and down.
    axes: array<vec4<f32>, 18>,
    // Texels along a side of a face.
    map_size: u32,
    // Number of probes, and number of ranges of glass triangles.
    probes: u32,
    ranges: u32,
    // Index of refraction that stands for a whole pane.
    index: f32,
    // The number of a `Fresnel`: 0 for Fresnel's equations, 1 for Schlick's approximation, 2 and 3 for s-polarised and p-polarised light.
    fresnel: u32,
}

// Six layers for each probe, one for each face.
@group(1) @binding(3) var faces: texture_2d_array<f32>;
// First triangle and end of each range of glass triangles, ascending.
@group(1) @binding(4) var<storage, read> glass: array<vec2<u32>>;
@group(1) @binding(5) var<storage, read> probes: array<Probe>;

fn compute(pixel: vec2<u32>) -> vec4<f32> {
    let color = textureLoad(color_buffer, pixel, 0);
    if params.probes == 0u || !is_glass(textureLoad(triangle_buffer, pixel, 0).x - frame.id_base) {
        return color;
    }
    let position = textureLoad(position_buffer, pixel, 0).xyz;
    let seen = facing(params.eye.xyz, position, textureLoad(normal_buffer, pixel, 0).xyz);
    if !seen.known {
        return color;
    }
    let probe = nearest(position);
    let mirrored = seen.view - 2.0 * seen.normal * dot(seen.normal, seen.view);
//#if REFRACT
    let interface_ = fresnel(-dot(seen.normal, seen.view));
    var result = vec3<f32>(0.0);
    if interface_.reflectance > 0.0 {
        result += interface_.reflectance * sample_cube(probe, position, mirrored);
    }
    if interface_.reflectance < 1.0 {
        let along = seen.view - seen.normal * dot(seen.normal, seen.view);
        let bent = along / params.index - seen.normal * interface_.cos_refracted;
        result += (1.0 - interface_.reflectance) * sample_cube(probe, position, bent);
    }
    return vec4<f32>(result, 1.0);
//#else
    return vec4<f32>(sample_cube(probe, position, mirrored), 1.0);
//#endif
}
