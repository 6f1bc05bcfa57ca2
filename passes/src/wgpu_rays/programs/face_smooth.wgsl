// What a surface of glass reflects, and where light goes on: Fresnel's share.
fn face_of(body: Body, cosine: f32, ratio: f32) -> Interface { return interface_at(cosine, ratio); }
