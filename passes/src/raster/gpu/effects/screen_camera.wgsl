
// Maps positions to places on the screen: `raster::effects::screen::camera`.
struct ScreenCamera {
    columns: vec4<f32>,
    rows: vec4<f32>,
    depths: vec4<f32>,
    // Origin of the positions; w is 1 in perspective, else 0.
    origin: vec4<f32>,
    // w is the nearness of the near plane.
    right: vec4<f32>,
    // w is the nearness of the farthest depth.
    down: vec4<f32>,
    // w is the tolerated gap between the pieces of neighbouring pixels.
    forward: vec4<f32>,
}

// Column, row and nearness of a position; a nearness of NOTHING where it has none.
fn place_of(camera: ScreenCamera, position: vec3<f32>) -> vec3<f32> {
    let seen = vec4<f32>(position - camera.origin.xyz, 1.0);
    let place = vec3<f32>(dot(camera.columns, seen), dot(camera.rows, seen), dot(camera.depths, seen));
    if camera.origin.w == 0.0 {
        return vec3<f32>(place.xy, -place.z);
    }
    if !(place.z > SMALLEST) {
        return vec3<f32>(0.0, 0.0, NOTHING);
    }
    return vec3<f32>(place.xy, 1.0) / place.z;
}

// The surface that a pixel shows, as a piece of a plane.
struct Piece {
    place: vec3<f32>,
    slope: vec2<f32>,
    normal: vec3<f32>,
    // False where the pixel shows nothing.
    known: bool,
}

fn piece_of(camera: ScreenCamera, position: vec3<f32>, stored_normal: vec3<f32>) -> Piece {
    let size = sqrt(dot(stored_normal, stored_normal));
    let place = place_of(camera, position);
    if !(size > 0.0 && size < LARGEST && all(abs(place) < vec3<f32>(LARGEST))) {
        return Piece(vec3<f32>(0.0), vec2<f32>(0.0), vec3<f32>(0.0), false);
    }
    let perspective = camera.origin.w != 0.0;
    let away = select(camera.forward.xyz, position - camera.origin.xyz, perspective);
    let unit_normal = stored_normal / size;
    let cosine = dot(unit_normal, away);
    let normal = select(unit_normal, -unit_normal, cosine > 0.0);
    let slant = max(abs(cosine), LEAST_COSINE * sqrt(dot(away, away)));
    var slope = -vec2<f32>(dot(normal, camera.right.xyz), dot(normal, camera.down.xyz)) / slant;
    let sum = abs(slope.x) + abs(slope.y);
    if perspective && sum > place.z {
        slope *= place.z / sum;
    }
    return Piece(place, slope, normal, true);
}

fn nearness_at(piece: Piece, at: vec2<f32>) -> f32 {
    return piece.place.z + piece.slope.x * (at.x - piece.place.x) + piece.slope.y * (at.y - piece.place.y);
}
