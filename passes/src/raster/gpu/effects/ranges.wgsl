
// Where a triangle is looked up in ranges of triangles that are glass: first triangle and end in x and y of each, ascending.

// How many ranges there are up to the one that a triangle is in; 0 for what is in none, and for ids of no triangle.
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
