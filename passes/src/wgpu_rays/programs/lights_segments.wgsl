// With lights that are discs: from now on the light is looked for along a segment on which focused light comes.
fn look_along(direction: vec3f, length: f32) {
    light_direction = direction;
    light_length = length;
}
// Who asks for a light next says which one.
fn look_at_sun() {}

