// Refraction of parallel light by a sphere of glass of radius 1, in a plane that contains the axis (`ball.rs`, which gives the formulas), with
// the numbers of the processor, step by step. Places and directions in the plane have their distance from the axis in x.
#pragma once
#include "vector.cuh"

constexpr double RIGHT_ANGLE = 1.5707963267948966, HALF_TURN = 3.141592653589793;

DEVICE Turned turned_at(double incidence, double index) {
    double sin, cos;
    sincos(incidence, &sin, &cos);
    double inner_sin = sin / index;
    double inner = sqrt(1.0 - inner_sin * inner_sin);
    // Sine and cosine of half the ray's turn.
    double half_sin = sin * inner - cos * inner_sin, half_cos = cos * inner + sin * inner_sin;
    return {sin,
            cos,
            inner,
            {-2.0 * half_sin * half_cos, half_cos * half_cos - half_sin * half_sin},
            2.0 * (1.0 - cos / (index * inner))};
}
// How far along the ray a point lies, from where the ray passes the centre.
DEVICE double along(const Turned &ray, double2 at) { return at.x * ray.direction[0] + at.y * ray.direction[1]; }
// Signed distance at which the ray passes a point, and its derivative by the angle of incidence.
DEVICE double miss_of(const Turned &ray, double2 at) { return at.x * ray.direction[1] - at.y * ray.direction[0] - ray.sin; }
DEVICE double miss_rate(const Turned &ray, double2 at) { return ray.rate * along(ray, at) - ray.cos; }
// Whether a point lies behind the sphere, as the ray sees it.
DEVICE bool reaches(const Turned &ray, double2 at) { return along(ray, at) > ray.cos; }
// Where the ray meets the sphere, and where it leaves it.
DEVICE double2 entry_of(const Turned &ray) { return make_double2(ray.sin, -ray.cos); }
DEVICE double2 exit_of(const Turned &ray) {
    return make_double2(ray.sin * ray.direction[1] + ray.cos * ray.direction[0],
                        ray.sin * -ray.direction[0] + ray.cos * ray.direction[1]);
}

// The angle whose cosine is 1 - u.
DEVICE double angle_of(double u) { return 2.0 * asin(sqrt(0.5 * fmin(fmax(u, 0.0), 1.0))); }
// Half of the range of angles by which the ray may be turned about the axis and still pass the point nearer than `width`.
DEVICE double half_angle(const Turned &ray, double2 at, double width) {
    double miss = miss_of(ray, at), x = at.x, c = ray.direction[1], s = ray.direction[0];
    double a = x * x * s * s, b = 2.0 * x * (x - miss * c), c0 = (width - miss) * (width + miss);
    double discriminant = b * b - 4.0 * a * c0;
    if (discriminant < 0.0 || (b <= 0.0 && c0 >= 0.0)) return RIGHT_ANGLE;
    if (x == 0.0) return 0.0;
    double root = sqrt(discriminant);
    if (b <= 0.0) return RIGHT_ANGLE - angle_of(2.0 * c0 / (b - root));
    double q = b + root;
    double beyond = 2.0 * a > q ? fmax(0.0, RIGHT_ANGLE - angle_of(0.5 * q / a)) : 0.0;
    return angle_of(2.0 * c0 / q) + beyond;
}

// The root of a function between two places at which its signs differ; `first` has its sign at the first place. `function(place, rate)` sets
// `rate` to the derivative where it is known, and otherwise leaves it.
template <class Function> DEVICE double root_of(double low, double high, double first, double tolerance, Function &&function) {
    double place = 0.5 * (low + high), other = 0.0, value_there = 0.0;
#pragma unroll 1
    for (unsigned step = 0; step < 60; ++step) {
        // Without a derivative, that of the line through the last two places.
        double rate = NAN;
        double value = function(place, rate);
        if (fabs(value) <= tolerance) break;
        if ((value < 0.0) == (first < 0.0)) {
            low = place;
        } else {
            high = place;
        }
        if (isnan(rate) && step > 0) rate = (value - value_there) / (place - other);
        other = place;
        value_there = value;
        double next = place - value / rate;
        place = next > low && next < high ? next : 0.5 * (low + high);
        if (high - low <= 2.220446049250313e-16) break;
    }
    return place;
}

// The refraction by an index above 1.
struct Ball {
    // Rays of CELLS + 1 angles of incidence, and the points of both quadratures.
    const Turned *nodes;
    const double2 *points;
    double index;
};

// Rays that are neighbours, and reach a point together.
struct Bundle {
    Turned ray;
    // 1 if they met the sphere on the point's side of the axis, else -1.
    double side;
    double3 strength;
};

// The bundles of rays that reach a point outside the sphere, one after the other. `kept(ray)` is the share of its light that a ray keeps, by
// colour.
template <class Kept> struct Bundles {
    // An angle of incidence, and how far its ray misses the point.
    struct End {
        double incidence, miss;
    };
    // Sums over the rays of a bundle. Angles of incidence are summed with their weights.
    struct Sum {
        double3 strength;
        double weight, incidence, end;
    };

    const Ball &ball;
    const Kept &kept;
    double2 at;
    double width, reach, side;
    // The next step of the angle of incidence, and what is known at its begin.
    unsigned cell;
    double miss, rate;
    bool reached;
    // Where m has an extremum within a step, the part behind that is still to be searched.
    bool waits;
    End second[2];
    // The bundle to which the last piece belongs.
    bool is_open;
    Sum open;

    // `distance` from the axis, at least 0, and place along it. Bundles are means over discs of radius `width`.
    DEVICE_MEMBER Bundles(const Ball &ball, const Kept &kept, double distance, double place, double width)
        : ball(ball), kept(kept), at(make_double2(distance, place)), width(width) {
        // A ray that passes the point at a greater distance may pass it nearer when it is turned about the axis, but only near the axis.
        reach = distance < width ? width + distance : width;
        begin(1.0);
    }
    DEVICE_MEMBER void begin(double of_side) {
        side = of_side;
        cell = 0;
        const Turned &first = ball.nodes[0];
        miss = miss_of(first, at);
        rate = miss_rate(first, at);
        reached = reaches(first, at);
        waits = is_open = false;
        open = {};
    }
    DEVICE_MEMBER double at_node(unsigned node) const { return RIGHT_ANGLE * (double)node / (double)CELLS; }

    // The next bundle; false where there is none left.
    DEVICE_MEMBER bool next(Bundle &bundle) {
        while (true) {
            double low, high;
            bool found = next_piece(low, high);
            Sum sum = {};
            if (found) sum = sum_of(low, high);
            if (found && is_open && open.end >= low) {
                open.strength = open.strength + sum.strength;
                open.weight += sum.weight;
                open.incidence += sum.incidence;
                open.end = high;
                continue;
            }
            bool closes = is_open && open.weight > 0.0, ends = !found && side < 0.0;
            if (closes) bundle = {turned_at(open.incidence / open.weight, ball.index), side, open.strength};
            is_open = found;
            open = sum;
            if (!found && !ends) {
                at.x = -at.x;
                begin(-1.0);
            }
            if (closes) return true;
            if (ends) return false;
        }
    }

    // The next angles of incidence, in ascending pieces, whose rays pass the point nearer than `reach`; false where this side has none left.
    DEVICE_MEMBER bool next_piece(double &low, double &high) {
        while (waits || cell < CELLS) {
            End ends[2];
            if (waits) {
                ends[0] = second[0];
                ends[1] = second[1];
                waits = false;
            } else if (!next_step(ends)) {
                continue;
            }
            if (narrowed(ends, low, high)) return true;
        }
        return false;
    }
    // The ends of the next step, or of its part up to an extremum; false where no ray of the step passes the point near enough.
    DEVICE_MEMBER bool next_step(End (&ends)[2]) {
        const Turned &node = ball.nodes[cell + 1];
        double miss_before = miss, rate_before = rate;
        bool reached_before = reached;
        miss = miss_of(node, at);
        rate = miss_rate(node, at);
        reached = reaches(node, at);
        ends[0] = {at_node(cell), miss_before};
        ends[1] = {at_node(cell + 1), miss};
        cell += 1;
        bool turns = rate_before * rate < 0.0;
        double slack = turns ? RIGHT_ANGLE / (double)CELLS * fmax(fabs(rate_before), fabs(rate)) : 0.0;
        bool above = fmin(miss_before, miss) > reach + slack, below = fmin(-miss_before, -miss) > reach + slack;
        if (!(reached_before || reached) || above || below) return false;
        if (turns) {
            double top = root_of(ends[0].incidence, ends[1].incidence, rate_before, 1e-9, [&](double incidence, double &) {
                return miss_rate(turned_at(incidence, ball.index), at);
            });
            second[0] = {top, miss_of(turned_at(top, ball.index), at)};
            second[1] = ends[1];
            ends[1] = second[0];
            waits = true;
        }
        return true;
    }
    // The part of the angles between two that is within reach; between them the distance is monotonic.
    DEVICE_MEMBER bool narrowed(const End (&ends)[2], double &low, double &high) const {
        if (fmin(ends[0].miss, ends[1].miss) > reach || fmax(ends[0].miss, ends[1].miss) < -reach) return false;
        double places[2];
#pragma unroll 1
        for (unsigned i = 0; i < 2; ++i) {
            places[i] = ends[i].incidence;
            if (fabs(ends[i].miss) <= reach) continue;
            double border = copysign(reach, ends[i].miss);
            places[i] = root_of(ends[0].incidence, ends[1].incidence, ends[0].miss - border, 1e-9 * reach,
                                [&](double incidence, double &slope) {
                                    Turned ray = turned_at(incidence, ball.index);
                                    slope = miss_rate(ray, at);
                                    return miss_of(ray, at) - border;
                                });
        }
        low = places[0];
        high = places[1];
        return low < high;
    }
    // The light of the angles of incidence between two.
    DEVICE_MEMBER Sum sum_of(double low, double high) const {
        Sum sum = {make_double3(0.0, 0.0, 0.0), 0.0, 0.0, high};
        bool near_axis = fabs(at.x) < 2.0 * width;
        const double2 *points = ball.points + (near_axis ? POINTS : 0);
        unsigned count = near_axis ? POINTS_AT_AXIS : POINTS;
        double middle = 0.5 * (low + high), half = 0.5 * (high - low);
#pragma unroll 1
        for (unsigned i = 0; i < count; ++i) {
            double incidence = middle + half * points[i].x;
            Turned ray = turned_at(incidence, ball.index);
            if (!reaches(ray, at)) continue;
            double area = half * points[i].y * ray.sin * ray.cos * 2.0 * half_angle(ray, at, width) / (HALF_TURN * width * width);
            sum.strength = sum.strength + area * kept(ray);
            sum.weight += area;
            sum.incidence += area * incidence;
        }
        return sum;
    }
};
