// For lights that are discs: from now on, shadow rays follow a segment of the path of light that exact spheres focus.
fn look_along(direction: vec3f, length: f32) {
    light_direction = direction;
    light_length = length;
}
// The next caller sets the light that it needs, so there is nothing to restore.
fn look_at_sun() {}

