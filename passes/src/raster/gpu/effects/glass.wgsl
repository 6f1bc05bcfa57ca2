
// Whether a triangle is in one of the ranges; ids of no triangle are not.
fn is_glass(triangle: u32) -> bool {
    return range_of(triangle) != 0u;
}
