
struct Interface {
    reflectance: f32,
    cos_refracted: f32,
}

// Fresnel's equations (`effects::interface`), in single precision. `params.fresnel` is the number of a `Fresnel`.
fn fresnel(cosine: f32) -> Interface {
    let cos = clamp(cosine, 0.0, 1.0);
    let index = params.index;
    // Factored, so that the first term loses no digits for an index near 1.
    let discriminant = (index - 1.0) * (index + 1.0) + cos * cos;
    if discriminant <= 0.0 {
        return Interface(1.0, 0.0);
    }
    let bent = sqrt(discriminant) / index;
    if params.fresnel == 1u {
        // `effects::schlick`.
        let root = (index - 1.0) / (index + 1.0);
        let zero = root * root;
        let away = 1.0 - select(cos, min(bent, 1.0), index < 1.0);
        let square = away * away;
        return Interface(min(zero + (1.0 - zero) * (square * square * away), 1.0), bent);
    }
    let perpendicular = (cos - index * bent) / (cos + index * bent);
    let parallel = (index * cos - bent) / (index * cos + bent);
    let shares = vec2f(perpendicular * perpendicular, parallel * parallel);
    if params.fresnel == 2u {
        return Interface(shares.x, bent);
    }
    if params.fresnel == 3u {
        return Interface(shares.y, bent);
    }
    return Interface(0.5 * (shares.x + shares.y), bent);
}
