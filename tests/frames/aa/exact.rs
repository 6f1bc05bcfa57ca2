//! Coverage and averages against closed forms, and against a picture of eight times the size.

use super::{covered, flat, frame, mean, opened, rms, samples, settings};
use curitiba::Choice;
use curitiba::pipeline::color::ColorSpace;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::Settings;
use glam::{DVec2, Vec2};

const SIDE: u32 = 48;

/// The lower left corner of a pixel, in units of [`flat`] pictures.
fn corner(index: usize) -> DVec2 {
    let (x, y) = (index as u32 % SIDE, index as u32 / SIDE);
    DVec2::new(f64::from(x), f64::from(SIDE - 1 - y)) - f64::from(SIDE) / 2.0
}

/// The area of the unit square with this lower left corner inside a counter-clockwise convex polygon; the square is
/// clipped by each side.
fn area(corner: DVec2, polygon: &[DVec2]) -> f64 {
    let mut cut: Vec<DVec2> = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|p| corner + DVec2::from(p)).into();
    for (index, from) in polygon.iter().enumerate() {
        let along = polygon[(index + 1) % polygon.len()] - *from;
        let inside = |point: DVec2| along.perp_dot(point - *from);
        let mut next = Vec::new();
        for (place, point) in cut.iter().enumerate() {
            let other = cut[(place + 1) % cut.len()];
            let (a, b) = (inside(*point), inside(other));
            if a >= 0.0 {
                next.push(*point);
            }
            if (a < 0.0) != (b < 0.0) {
                next.push(*point + (other - *point) * (a / (a - b)));
            }
        }
        cut = next;
    }
    (0..cut.len()).map(|place| cut[place].perp_dot(cut[(place + 1) % cut.len()]) / 2.0).sum()
}

/// Root mean square and greatest error over the pixels that an edge crosses.
fn error(found: &[f64], exact: &[f64]) -> [f64; 2] {
    let crossed = found.iter().zip(exact).filter(|(_, exact)| (1e-6..1.0 - 1e-6).contains(*exact));
    let off: Vec<f64> = crossed.map(|(found, exact)| found - exact).collect();
    assert!(off.len() >= SIDE as usize / 2, "an edge crosses pixels");
    [
        (off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64).sqrt(),
        off.iter().fold(0.0, |most, off| most.max(off.abs())),
    ]
}

/// The half-plane to the left of a line through a point, as a triangle far larger than the picture.
fn half_plane(through: DVec2, degrees: f64) -> [DVec2; 3] {
    let along = DVec2::from_angle(degrees.to_radians());
    [through - along * 400.0, through + along * 400.0, through + along.perp() * 400.0]
}

fn exact(polygon: &[DVec2]) -> Vec<f64> {
    (0..(SIDE * SIDE) as usize).map(|index| area(corner(index), polygon)).collect()
}

#[test]
fn areas_are_those_of_the_textbook() {
    let triangle = [DVec2::ZERO, DVec2::X, DVec2::Y];
    assert!((area(DVec2::ZERO, &triangle) - 0.5).abs() < 1e-15 && area(DVec2::splat(2.0), &triangle) == 0.0);
    assert!((exact(&triangle.map(|p| p * 7.5)).iter().sum::<f64>() - 7.5 * 7.5 / 2.0).abs() < 1e-12);
}

/// At a general slope the error of `N` samples falls as `N^-3/4`, because an edge crosses `√N` of `N` cells with one
/// sample each. For vertical and horizontal edges it falls as `1 / N`.
#[test]
fn half_planes_cover_their_area() {
    for (degrees, along_axes) in [
        (0.0, true),
        (90.0, true),
        (180.0, true),
        (1.2, true),
        (91.5, true),
        (17.0, false),
        (45.0, false),
        (63.4, false),
        (128.7, false),
    ] {
        for count in [4, 16, 64] {
            let (mut squares, mut largest) = (0.0, 0.0_f64);
            for (x, y) in [(0.31, 0.17), (-0.23, 0.44), (0.07, -0.39), (0.48, 0.02)] {
                let half = half_plane(DVec2::new(x, y), degrees);
                let found = covered(flat(&[half.map(|p| p.as_vec2())], SIDE, [0.0; 2]), count);
                let [rms, most] = error(&found, &exact(&half));
                (squares, largest) = (squares + rms * rms / 4.0, largest.max(most));
            }
            let (rms, n) = (f64::sqrt(squares), f64::from(count));
            // A horizontal edge gives `N + 1` shades: the error is at most half a shade, plus that of snapped corners.
            let bound = if along_axes {
                [0.36 / n + 0.004, 1.0 / n + 0.008]
            } else {
                [0.45 * n.powf(-0.75), 1.1 * n.powf(-0.75)]
            };
            println!("{degrees} degrees, {count} samples: {rms:.4}, largest {largest:.4}; bounds {bound:.4?}");
            assert!(
                rms < bound[0] && largest < bound[1],
                "{degrees} degrees, {count} samples: {rms} and {largest}, not {bound:?}"
            );
        }
        // Control: one sample gives only 0 or 1.
        let half = half_plane(DVec2::new(0.31, 0.17), degrees);
        let [rms, _] = error(&covered(flat(&[half.map(|p| p.as_vec2())], SIDE, [0.0; 2]), 1), &exact(&half));
        assert!(rms > 0.15, "{degrees} degrees: {rms}");
    }
}

#[test]
fn a_triangle_narrower_than_a_pixel_keeps_its_area() {
    // A thin triangle, 0.3 pixels wide at its base, diagonally across the picture.
    let thin = [DVec2::new(-17.2, -20.1), DVec2::new(-16.9, -20.13), DVec2::new(12.3, 19.4)];
    let exact = exact(&thin);
    let whole: f64 = exact.iter().sum();
    let mut before = f64::INFINITY;
    for count in [1, 4, 16, 64] {
        let found = covered(flat(&[thin.map(|p| p.as_vec2())], SIDE, [0.0; 2]), count);
        let sum: f64 = found.iter().sum();
        let rms = (found.iter().zip(&exact).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / found.len() as f64).sqrt();
        println!("{count} samples: {sum:.3} of {whole:.3}, error {rms:.5}");
        assert!(rms < 0.62 * before, "{count} samples: {rms} after {before}");
        // Corners are snapped to 1/256 of a pixel, about a hundredth of this width.
        assert!(count < 64 || (sum / whole - 1.0).abs() < 0.03, "{sum} of {whole}");
        before = rms;
    }
    assert!(before < 0.006, "{before}");
}

#[test]
fn no_sample_shifts_the_picture() {
    // A half turn about the picture's centre maps the triangles onto each other, and the samples as well.
    let one = [Vec2::new(-19.3, -11.7), Vec2::new(-2.6, -15.2), Vec2::new(-9.1, 8.9)];
    let other = one.map(|corner| -corner);
    // Mirroring keeps vertical edges, because each column has one sample.
    let upright = [[-7.37, -99.0], [7.37, -99.0], [7.37, 99.0], [-7.37, 99.0]].map(Vec2::from);
    let box_of = |[a, b, c, d]: [Vec2; 4]| [[a, b, c], [a, c, d]];
    let side = SIDE as usize;
    // Mirrored at a vertical axis. No sample set with one sample in each row and column is its own mirror image.
    let isosceles = [Vec2::new(-11.3, -18.7), Vec2::new(11.3, -18.7), Vec2::new(0.0, 17.9)];
    for count in [2, 4, 8, 16, 32, 64] {
        let turned = covered(flat(&[one, other], SIDE, [0.0; 2]), count);
        assert!((0..side * side).all(|index| turned[index] == turned[side * side - 1 - index]), "{count}: half a turn");
        let mirrored = covered(flat(&box_of(upright), SIDE, [0.0; 2]), count);
        assert!(
            (0..side * side).all(|index| mirrored[index] == mirrored[index / side * side + side - 1 - index % side]),
            "{count}: a mirror"
        );
        // The centroid of the coverage is on the axis, up to a fortieth of a pixel; the place of one sample would show
        // as an error.
        let found = covered(flat(&[isosceles], SIDE, [0.0; 2]), count);
        let moment: f64 = found.iter().enumerate().map(|(index, share)| share * (corner(index).x + 0.5)).sum();
        let off = moment / found.iter().sum::<f64>();
        println!("{count}: the middle is off by {off:.5}");
        assert!(off.abs() < 0.025, "{count}: {off}");
        // Control: a displacement of an eighth of a pixel is detected.
        let found = covered(flat(&[isosceles], SIDE, [-0.125, 0.0]), count);
        let moment: f64 = found.iter().enumerate().map(|(index, share)| share * (corner(index).x + 0.5)).sum();
        assert!((moment / found.iter().sum::<f64>() - 0.125).abs() < 0.025);
    }
}

#[test]
fn the_mean_is_that_of_pictures_that_were_moved_by_hand() {
    let triangles = [
        [Vec2::new(-19.3, -11.7), Vec2::new(12.6, -15.2), Vec2::new(-3.1, 18.9)],
        [Vec2::new(3.3, -21.7), Vec2::new(22.6, 1.2), Vec2::new(5.1, 3.9)],
    ];
    for count in [2, 4, 16, 64] {
        let moved = |sample: u32| {
            let project = flat(&triangles, SIDE, samples(count).offset(sample));
            let settings = Settings { color: Some(ColorSpace::Linear), ..Settings::default() };
            let mut renderer = curitiba::open_project(project, settings, Choice::CPU, &mut Silent).expect("it opens");
            frame(&mut renderer)
        };
        let by_hand = mean(&(0..count).map(moved).collect::<Vec<_>>());
        let found = covered(flat(&triangles, SIDE, [0.0; 2]), count);
        let same = found.iter().zip(&by_hand.pixels).all(|(found, pixel)| *found == f64::from(pixel[0]));
        assert!(same, "{count} samples differ from as many pictures");
    }
}

/// The means of squares of 8 x 8 pixels.
fn reduced(picture: &Image) -> Image {
    let (width, height) = (picture.width / 8, picture.height / 8);
    let mut pixels = vec![[0.0_f64; 4]; (width * height) as usize];
    for (index, pixel) in picture.pixels.iter().enumerate() {
        let (x, y) = (index as u32 % picture.width / 8, index as u32 / picture.width / 8);
        let sum = &mut pixels[(y * width + x) as usize];
        sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += f64::from(*value) / 64.0);
    }
    Image { width, height, pixels: pixels.into_iter().map(|sum| sum.map(|sum| sum as f32)).collect() }
}

/// A picture of eight times the size is another way to take many samples. Edges, textures and their levels of detail agree
/// with it.
#[test]
fn pictures_tend_to_those_of_eight_times_the_size() {
    for (name, least) in [
        ("SceneNoEffects", [0.65, 0.55, 0.55]),
        ("SceneShadows", [0.65, 0.55, 0.55]),
        ("SceneRefract", [0.7, 0.7, 0.7]),
    ] {
        for color in [ColorSpace::Report, ColorSpace::Linear] {
            let of = |count: u32| Settings { color: Some(color), ..settings(name, count) };
            let large = frame(&mut opened(name, Settings { size: Some([896, 640]), ..of(1) }));
            let reference = reduced(&large);
            let errors = [1, 4, 16, 64].map(|count| rms(&frame(&mut opened(name, of(count))), &reference));
            println!("{name}, {color}: {errors:.5?}");
            for (errors, least) in errors.windows(2).zip(least) {
                assert!(errors[1] < least * errors[0], "{name}, {color}: {errors:?}");
            }
        }
    }
}
