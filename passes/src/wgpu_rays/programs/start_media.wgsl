// The media at the start of a line (`media.rs`).

// What is known of a line: by crossing, the body, or NONE where what is crossed is none; whether the line enters it there.
var<private> crossed: array<u32, MAX_LINE>;
var<private> entered: array<bool, MAX_LINE>;

// A body that is left without having been entered holds the start, the one left first innermost.
fn media_at_start(crossings: u32) -> Media {
    var media: Media;
    for (var last = crossings; last > 0u; last -= 1u) {
        let body = crossed[last - 1u];
        if body == NONE || entered[last - 1u] { continue; }
        // Whether one of the same body before it was entered and not left.
        var inside = 0u;
        for (var i = 0u; i < last - 1u; i += 1u) {
            if crossed[i] != body { continue; }
            if entered[i] { inside += 1u; } else if inside > 0u { inside -= 1u; }
        }
        if inside == 0u { let fills = put_body(&media, body); }
    }
    return media;
}
