// Parallel light that a sphere of glass refracts (`effects/dielectric/ball.rs`, whose text has the formulas), in numbers of 32 bits. Lengths are
// in radii of the sphere.
//
// Bundles are a thousandth of a radius wide, and points lie many radii away. So the distance m at which a ray passes a point is computed in 48
// bits at the nodes, which lie at every 64th part of a right angle. Between nodes, the small changes of sines and angles are added. The error of m
// is about 6e-9 of the distance to the point, plus 1e-8.

// A node in the tables, for an index of refraction: sine and cosine of its angle of incidence, of the angle by which light is turned, and of the
// angle inside; and the derivative of the turning angle.
fn node_place(index_at: u32, node: u32) -> u32 { return index_at + NODE_WORDS * node; }

// A point outside of a sphere, in the plane of the axis: its distance from the axis, which is negative if light meets the sphere on the other side;
// its place along the axis; the width of the discs over which light is averaged; and the distance at which a ray may pass the point.
struct Aim { x: Wide, z: Wide, width: f32, reach: f32, index: f32, index_at: u32 }

// A ray that has passed the sphere: sine and cosine of the angle of incidence, of the angle inside, and of the angle by which it is turned. Then the
// distance at which it passes the point (m), the point's place along and across the ray, and the derivative of the turning angle.
struct Turned {
    sin: f32,
    cos: f32,
    inner_sin: f32,
    inner: f32,
    turn_sin: f32,
    turn_cos: f32,
    miss: f32,
    along: f32,
    across: f32,
    rate: f32,
}
fn miss_rate(ray: Turned) -> f32 { return ray.rate * ray.along - ray.cos; }
// The derivative of `miss_rate`.
fn miss_curve(ray: Turned, index: f32) -> f32 {
    let inner_rate = ray.cos / (index * ray.inner);
    let curve = 2.0 * (ray.sin * ray.inner - ray.cos * ray.inner_sin * inner_rate) / (index * ray.inner * ray.inner);
    return curve * ray.along - ray.rate * ray.rate * ray.across + ray.sin;
}

// The ray of a node.
fn turned_at(aim: Aim, node: u32) -> Turned {
    let place = node_place(aim.index_at, node);
    let sin = Wide(table_number(place), table_number(place + 1u));
    let turn_sin = Wide(table_number(place + 3u), table_number(place + 4u));
    let turn_cos = Wide(table_number(place + 5u), table_number(place + 6u));
    let across = add(mul(aim.x, turn_cos), mul(aim.z, turn_sin));
    let along = aim.z.h * turn_cos.h - aim.x.h * turn_sin.h;
    return Turned(sin.h, table_number(place + 2u), table_number(place + 7u), table_number(place + 8u), turn_sin.h, turn_cos.h,
                  add(across, minus(sin)).h, along, across.h, table_number(place + 9u));
}
// The ray whose angle of incidence is larger by `more`, a few hundredths at most.
fn turned_from(base: Turned, more: f32, index: f32) -> Turned {
    let square = more * more;
    let sin_more = more * (1.0 - square / 6.0 * (1.0 - square / 20.0));
    let below = 0.5 * square * (1.0 - square / 12.0);
    let sin_change = base.cos * sin_more - base.sin * below;
    let cos = base.cos - (base.sin * sin_more + base.cos * below);
    // The changes of the angle inside, and of the angle of incidence minus the angle inside. Light is turned by twice that difference.
    let inner_change = sin_change / index;
    let inner_sin = base.inner_sin + inner_change;
    let lower = inner_change * (base.inner_sin + inner_sin);
    let inner = sqrt(max(base.inner * base.inner - lower, 1.0e-12));
    let inner_more = inner_change * base.inner + lower / (base.inner + inner) * base.inner_sin;
    let half_turn = sin_more * sqrt(1.0 - inner_more * inner_more) - (1.0 - below) * inner_more;
    let turn = 2.0 * half_turn * sqrt(1.0 - half_turn * half_turn);
    let turn_below = 2.0 * half_turn * half_turn;
    return Turned(base.sin + sin_change, cos, inner_sin, inner,
                  base.turn_sin + (base.turn_cos * turn - base.turn_sin * turn_below),
                  base.turn_cos - (base.turn_sin * turn + base.turn_cos * turn_below),
                  base.miss + ((base.along * turn - base.across * turn_below) - sin_change),
                  base.along - (base.across * turn + base.along * turn_below),
                  base.across + (base.along * turn - base.across * turn_below),
                  2.0 * (1.0 - cos / (index * inner)));
}
// The ray of a cell, from the nearer one of its nodes.
fn turned_between(base: Turned, next: Turned, more: f32, index: f32) -> Turned {
    var node = base;
    let is_late = more > 0.5 * STEP;
    if is_late { node = next; }
    return turned_from(node, more - select(0.0, STEP, is_late), index);
}

// Twice the angle whose sine is the root of half of a number from 0 to 1. The polynomial is within 5e-9 of the arc sine for squares up to 1/4.
fn angle_below(u: f32) -> f32 {
    let half_u = 0.5 * clamp(u, 0.0, 1.0);
    let is_large = half_u > 0.25;
    let square = select(half_u, 0.5 * (1.0 - sqrt(half_u)), is_large);
    let sum = 1.0 + square * (1.666678201e-1 + square * (7.494696687e-2 + square * (4.552063564e-2 + square * (2.399399964e-2 + square * 4.241737378e-2))));
    let angle = sqrt(square) * sum;
    return 2.0 * select(angle, RIGHT_ANGLE - 2.0 * angle, is_large);
}
// Half of the angle about the axis over which the ray passes the point nearer than the width (`half_angle` of `ball.rs`).
fn half_angle(ray: Turned, x: f32, width: f32) -> f32 {
    let a = x * x * ray.turn_sin * ray.turn_sin;
    let b = 2.0 * x * (x - ray.miss * ray.turn_cos);
    let c = (width - ray.miss) * (width + ray.miss);
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 || (b <= 0.0 && c >= 0.0) { return RIGHT_ANGLE; }
    if x == 0.0 { return 0.0; }
    let root = sqrt(discriminant);
    if b <= 0.0 { return RIGHT_ANGLE - angle_below(2.0 * c / (b - root)); }
    let q = b + root;
    var angle = angle_below(2.0 * c / q);
    if 2.0 * a > q { angle += max(RIGHT_ANGLE - angle_below(0.5 * q / a), 0.0); }
    return angle;
}

// Neighbouring rays that reach the point together: their light by colour; the sum of their weights, and of the angles of incidence in steps times
// the weights; and the end of the last ray: its cell, and its place in the cell.
struct Bundle { strength: vec3f, weight: f32, incidence: f32, cell: u32, end: f32 }
// The bundle's mean ray.
fn mean_of(bundle: Bundle, aim: Aim) -> Turned {
    let incidence = bundle.incidence / bundle.weight;
    let node = min(u32(max(incidence + 0.5, 0.0)), CELLS);
    return turned_from(turned_at(aim, node), (incidence - f32(node)) * STEP, aim.index);
}

// Finds the bundles that reach a point at the distance `aim.x` from the axis, which is not below 0. Each is handed to `take_bundle` with its mean ray
// and the side on which it met the sphere. `kept_by` gives the share that a ray keeps in the sphere.
//
// In each cell between two nodes, m rises, falls, or turns once. A turn divides the cell into the parts before and behind it.
fn find_bundles(both_sides: Aim) {
    var aim = both_sides;
    let far = abs(aim.x.h) + abs(aim.z.h);
    let doubt = 4.0e-7 * (1.0 + far);
    for (var side = 0u; side < 2u; side += 1u) {
        if side == 1u { aim.x = minus(aim.x); }
        var is_open = false;
        var bundle: Bundle;
        var before = vec2f(0.0);
        var is_reached = false;
        // In the first round there is no cell yet, and in the last one none is left.
        for (var turn = 0u; turn < CELLS + 2u; turn += 1u) {
            var after = vec2f(0.0);
            var reaches = false;
            if turn <= CELLS {
                let place = node_place(aim.index_at, turn);
                let sin = table_number(place); let cos = table_number(place + 2u);
                let turn_sin = table_number(place + 3u); let turn_cos = table_number(place + 5u);
                let along = aim.z.h * turn_cos - aim.x.h * turn_sin;
                after = vec2f(aim.x.h * turn_cos + aim.z.h * turn_sin - sin, table_number(place + 9u) * along - cos);
                reaches = along > cos;
            }
            let turns = before.y * after.y < 0.0;
            var slack = doubt;
            if turns { slack += STEP * max(abs(before.y), abs(after.y)); }
            let is_beyond = max(min(before.x, after.x), -max(before.x, after.x)) > aim.reach + slack;
            let is_last = turn == CELLS + 1u;
            let is_cell = turn > 0u && !is_last && (is_reached || reaches) && !is_beyond;
            before = after;
            is_reached = reaches;
            if !is_cell && !is_last { continue; }
            let cell = turn - 1u;
            var base: Turned; var next: Turned;
            if is_cell {
                base = turned_at(aim, cell);
                next = turned_at(aim, cell + 1u);
            }
            // The place where m turns, and m there.
            var top = vec2f(STEP, next.miss);
            for (var part = 0u; part < select(1u, 2u, turns && is_cell); part += 1u) {
                var found: Bundle;
                var is_found = false;
                if is_cell {
                    var low = vec2f(0.0, base.miss);
                    var high = top;
                    if part == 1u {
                        low = top;
                        high = vec2f(STEP, next.miss);
                    }
                    // First the turn is searched for, then the two ends of the part.
                    for (var end = select(1u, 0u, turns && part == 0u); end < 3u; end += 1u) {
                        var from_to = vec2f(0.0, STEP);
                        var own = vec2f(0.0);
                        var first = miss_rate(base);
                        var border = 0.0;
                        var tolerance = 1.0e-5 * (1.0 + far);
                        if end > 0u {
                            if min(low.y, high.y) > aim.reach || max(low.y, high.y) < -aim.reach { break; }
                            own = select(low, high, end == 2u);
                            border = with_sign(aim.reach, own.y);
                            if abs(own.y) <= aim.reach {
                                if end == 2u { is_found = true; }
                                continue;
                            }
                            from_to = vec2f(low.x, high.x);
                            first = low.y - border;
                            tolerance = 3.0e-5 * aim.reach + 1.0e-8 * far;
                        }
                        // Newton's steps; the interval is halved where they lead out of it.
                        var at = 0.5 * (from_to.x + from_to.y);
                        var miss = 0.0;
                        for (var step = 0u; step < MOST_NEWTON; step += 1u) {
                            let ray = turned_between(base, next, at, aim.index);
                            miss = ray.miss;
                            var value = ray.miss - border;
                            var slope = miss_rate(ray);
                            if end == 0u {
                                value = slope;
                                slope = miss_curve(ray, aim.index);
                            }
                            if abs(value) <= tolerance { break; }
                            if (value < 0.0) == (first < 0.0) { from_to.x = at; } else { from_to.y = at; }
                            if from_to.y - from_to.x <= 2.0e-9 { break; }
                            let newton = at - value / slope;
                            let leads_on = slope != 0.0 && newton > from_to.x && newton < from_to.y;
                            at = select(0.5 * (from_to.x + from_to.y), newton, leads_on);
                        }
                        if end == 0u {
                            top = vec2f(at, miss);
                            high = top;
                        } else if end == 1u {
                            low.x = at;
                        } else {
                            high.x = at;
                            is_found = true;
                        }
                    }
                    is_found = is_found && low.x < high.x;
                    if is_found {
                        found = sum_of(aim, base, next, cell, vec2f(low.x, high.x));
                        if is_open && bundle.cell == cell && bundle.end == low.x {
                            found.strength += bundle.strength;
                            found.weight += bundle.weight;
                            found.incidence += bundle.incidence;
                            is_open = false;
                        }
                    }
                }
                if is_open && (is_found || is_last) && bundle.weight > 0.0 {
                    take_bundle(bundle, mean_of(bundle, aim), select(1.0, -1.0, side == 1u));
                }
                if is_found { bundle = found; }
                is_open = is_found || (is_open && !is_last);
            }
        }
    }
}

// The light of a range of angles of incidence within a cell.
fn sum_of(aim: Aim, base: Turned, next: Turned, cell: u32, range: vec2f) -> Bundle {
    let ends_there = range.y == STEP;
    var sum = Bundle(vec3f(0.0), 0.0, 0.0, select(cell, cell + 1u, ends_there), select(range.y, 0.0, ends_there));
    var first = 0u;
    var count = POINTS;
    if abs(aim.x.h) < 2.0 * aim.width {
        first = POINTS;
        count = POINTS_AT_AXIS;
    }
    let middle = 0.5 * (range.x + range.y);
    let half_way = 0.5 * (range.y - range.x);
    for (var i = 0u; i < count; i += 1u) {
        let place = point_place(first + i);
        let more = middle + half_way * table_number(place);
        let ray = turned_between(base, next, more, aim.index);
        if ray.along <= ray.cos { continue; }
        let share = half_way * table_number(place + 1u) * ray.sin * ray.cos;
        let area = share * 2.0 * half_angle(ray, aim.x.h, aim.width) / (2.0 * RIGHT_ANGLE * aim.width * aim.width);
        sum.strength += area * kept_by(ray);
        sum.weight += area;
        sum.incidence += area * (f32(cell) + more / STEP);
    }
    return sum;
}
