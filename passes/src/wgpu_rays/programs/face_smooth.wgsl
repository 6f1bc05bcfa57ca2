// The reflectance of a surface of glass by Fresnel's equations, and the cosine of the refracted ray.
fn face_of(body: Body, cosine: f32, ratio: f32) -> Interface { return interface_at(cosine, ratio); }
