
// Binary search for a triangle in the ranges of glass triangles. x and y of each range are its first triangle and its
// end; ranges ascend.

// One-based index of the range that contains a triangle; 0 if no range does, and for ids that do not belong to a triangle.
fn range_of(triangle: u32) -> u32 {
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
    if low == 0u || triangle >= glass[low - 1u].y {
        return 0u;
    }
    return low;
}
