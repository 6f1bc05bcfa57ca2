// Several lights, or lights with a place. These functions are shared by the programs that draw and shade triangles and spheres.
//#if LIGHTS

// A light, as `Light` of the pipeline.
struct Light {
    // w: 1 for a light with a place, 0 for a directional one.
    place: vec4<f32>,
    // w: 1 / range.
    direction: vec4<f32>,
    // w: the cone's exponent.
    color: vec4<f32>,
    // w: 1 for a spot light.
    attenuation: vec4<f32>,
    // Cosines of the inner and the outer angle.
    cone: vec4<f32>,
}

struct Lights {
    // x: number of lights.
    count: vec4<u32>,
    lights: array<Light, 256>,
}

@group(0) @binding(2) var<uniform> lamps: Lights;

// Unit direction to a light in xyz, and in w the share of its colour that arrives at a point: as `Light::at` of the pipeline.
fn arriving(light: Light, point: vec3<f32>) -> vec4<f32> {
    if light.place.w == 0.0 {
        return vec4<f32>(-light.direction.xyz, 1.0);
    }
    let way = light.place.xyz - point;
    let squared = dot(way, way);
    if !(squared > 0.0 && squared < 1e38) {
        return vec4<f32>(0.0);
    }
    let distance = sqrt(squared);
    let towards = way * (1.0 / distance);
    let divisor = light.attenuation.x + light.attenuation.y * distance + light.attenuation.z * squared;
    let near = distance * light.direction.w;
    var factor = max(1.0 - near * near * near * near, 0.0) / max(divisor, 1e-12);
    if light.attenuation.w != 0.0 {
        let cosine = -dot(towards, light.direction.xyz);
        var share = 0.0;
        if cosine >= light.cone.x {
            share = 1.0;
        } else if cosine > light.cone.y {
            share = (cosine - light.cone.y) / (light.cone.x - light.cone.y);
        }
        factor *= share * share;
        if light.color.w != 0.0 {
            factor *= pow(max(cosine, 0.0), light.color.w);
        }
    }
    return vec4<f32>(towards, factor);
}

// The sum, over the lights, of the light's colour that arrives at a point times the light's cosine; w: the greatest cosine of a light that
// arrives. Light from below the horizon of the unbent surface does not count.
fn sum_of_lights(point: vec3<f32>, normal: vec3<f32>, unbent: vec3<f32>) -> vec4<f32> {
    var sum = vec4<f32>(0.0);
    for (var index = 0u; index < lamps.count.x; index++) {
        let light = lamps.lights[index];
        let arrives = arriving(light, point);
        let lit = arrives.w > 0.0 && dot(arrives.xyz, unbent) > 0.0;
        let cosine = select(0.0, clamp(dot(arrives.xyz, normal), 0.0, 1.0), lit);
        sum = vec4<f32>(sum.rgb + light.color.rgb * (arrives.w * cosine), max(sum.w, cosine));
    }
    return sum;
}
//#endif
