// The media at the start of a line (`media.rs`).

// The crossings of a line: the body crossed, or NONE for a surface that belongs to no body; and whether the line enters the body there.
var<private> crossed: array<u32, MAX_LINE>;
var<private> entered: array<bool, MAX_LINE>;

// The media at the start of a line: a body that is left without having been entered contains the start, and the one left first is innermost.
fn media_at_start(crossings: u32) -> Media {
    var media: Media;
    for (var last = crossings; last > 0u; last -= 1u) {
        let body = crossed[last - 1u];
        if body == NONE || entered[last - 1u] { continue; }
        // Counts earlier entries into the same body that the line has not left again.
        var inside = 0u;
        for (var i = 0u; i < last - 1u; i += 1u) {
            if crossed[i] != body { continue; }
            if entered[i] { inside += 1u; } else if inside > 0u { inside -= 1u; }
        }
        if inside == 0u { let fills = put_body(&media, body); }
    }
    return media;
}
