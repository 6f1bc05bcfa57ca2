// Writes the colour of each pixel, one thread for each pixel: by a whole program, or from the results of earlier kernels.
@compute @workgroup_size(TILE, TILE, 1)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let tile = params.first_tile + group.y * groups.x + group.x;
    if tile >= params.end_tile { return; }
    let pixel = Pixel(tile % params.tiles_across * TILE + local.x, tile / params.tiles_across * TILE + local.y);
    if pixel.x >= params.width || pixel.y >= params.height { return; }
    textureStore(output, vec2u(pixel.x, pixel.y), picture(pixel));
    count_rays(tile);
}
