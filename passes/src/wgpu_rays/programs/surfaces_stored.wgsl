fn unturned(pixel: Pixel, triangle: u32) -> vec3f { return stored_normal(pixel); }
