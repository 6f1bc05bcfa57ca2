// Light that passes straight through glass (`shadow.rs`).

// Whether a line enters a body at a triangle, by the geometric normal.
fn line_enters(direction: vec3f, triangle: u32⟪, t: f32, origin: vec3f⟫) -> bool {
⟪    if is_sphere(triangle) {
        return dot3(met_on_sphere(sphere_of(triangle), origin, direction, t).normal, direction) < 0.0;
    }
⟫    let corners = positions_of(triangle);
    let first = corners.b - corners.a; let second = corners.c - corners.a;
    let scale = scale_to_one(max(most3(abs(first)), most3(abs(second))));
    let normal = wide_cross(difference(corners.b, corners.a, scale), difference(corners.c, corners.a, scale));
    return dot3(normal.h, direction) < 0.0;
}

⟪// The normal at a hit of the ray to the light that starts at `origin`.
fn line_normal_at(hit: Hit, origin: vec3f) -> vec3f {
    if is_sphere(hit.triangle) { return met_on_sphere(sphere_of(hit.triangle), origin, to_light(), hit.t).normal; }
    return normal_at(hit);
}

⟫// By colour channel, the share of the light that passes the crossed surfaces in a straight line, without refraction.
fn straight_through(⟪origin: vec3f⟫) -> vec3f {
    var kept = 0u;
    for (var i = 0u; i < crossings_stored; i += 1u) {
        let hit = crossing[i];
        let material = material_of(hit.triangle);
        let enters = line_enters(to_light(), hit.triangle⟪, hit.t, origin⟫);
        if kept > 0u {
            let before = crossing[kept - 1u];
            let same = hit.t - before.t <= 16.0 * UNIT_ROUNDOFF * hit.t && material == material_of(before.triangle) && enters == entered[kept - 1u];
            if same { continue; }
        }
        crossing[kept] = hit;
        crossed[kept] = select(NONE, material, shape_of(material) == SHAPE_SOLID);
        entered[kept] = enters;
        kept += 1u;
    }
    if crossings_beyond > 0u { count(LOST); }
    var media = media_at_start(kept);
    var passes = vec3f(1.0);
    var before = 0.0;
    for (var i = 0u; i < kept; i += 1u) {
        let hit = crossing[i];
        passes *= transmittance(extinction_in(media), hit.t - before);
        before = hit.t;
        let material = material_of(hit.triangle);
        let body = body_at(material, hit⟨, NO_FOOTPRINT⟩);
        let cosine = abs(dot3(normalize_or(⟪line_⟫normal_at(hit⟪, origin⟫), vec3f(0.0)), to_light()));
        if body.shape == SHAPE_SOLID {
            let ratio = cross_border(&media, material, entered[i]);
            if ratio == 0.0 { continue; }
            let face = face_of(body, cosine, max(ratio, 1.0 / ratio));
            passes *= (1.0 - face.reflectance) * filter_of(body, hit⟨, NO_FOOTPRINT⟩);
        } else if body.shape == SHAPE_THIN {
            let ratio = body.index / index_in(media);
            let face = face_of(body, cosine, max(ratio, 1.0 / ratio));
            passes *= wall_of(face.reflectance, kept_across(body, face.cos_refracted)).transmitted * filter_of(body, hit⟨, NO_FOOTPRINT⟩);
        } else {
            passes *= THROUGH_GLASS;
        }
    }
    return passes * transmittance(extinction_in(media), way_left(before));
}

