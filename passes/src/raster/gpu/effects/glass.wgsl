
// Whether a triangle is in one of the ranges; ids of no triangle are not.
fn is_glass(triangle: u32) -> bool {
    var low = 0u;
    var high = params.ranges;
    while low < high {
        let middle = (low + high) / 2u;
        if glass[middle].x <= triangle {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low > 0u && triangle < glass[low - 1u].y;
}
