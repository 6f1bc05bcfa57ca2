// The reflectance of a surface of glass by Fresnel's equations, and the refracted direction.
fn face_of(body: Body, cosine: f32, ratio: f32) -> Interface { return interface_at(cosine, ratio); }
