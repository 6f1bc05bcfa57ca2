// State for the surface whose light is computed next: the normal by which it is shaded, the key of its random numbers, and the hit if a ray
// met it; otherwise the camera sees it.
struct Shading { normal: vec3f, key: u32, is_met: bool, hit: Hit }
var<private> shading: Shading;
fn shaded_as_seen(normal: vec3f, key: u32) {
    shading.normal = normal;
    shading.key = key;
    shading.is_met = false;
}
fn shaded_as_met(hit: Hit, surface: Surface, key: u32) { shading = Shading(surface.normal, key, true, hit); }
