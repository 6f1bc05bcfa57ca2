
// Whether a triangle is in one of the ranges of glass; false for ids that do not belong to a triangle.
fn is_glass(triangle: u32) -> bool {
    return range_of(triangle) != 0u;
}
