// `dummy`: writes the input colour. What it costs is what joining the two systems costs.

fn corrected(pixel: Pixel) -> vec4f { return stored_color(pixel); }
fn thesis(pixel: Pixel) -> vec4f { return stored_color(pixel); }
