//! Quads that the device fills, compared with those that the host fills. Without an adapter, tests that need one print `skipped: why` and
//! pass; with `CURITIBA_REQUIRE_GPU_TESTS=1` they fail instead.

use super::*;
use crate::raster::gpu::AdapterChoice;
use crate::raster::gpu::lend::PICTURE_USAGE;
use curitiba_pipeline::image::{Codes, Image, count_non_finite};
use std::sync::Arc;

const WIDTH: u32 = 61;
const HEIGHT: u32 = 67;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;

fn gpu() -> Option<Gpu> {
    match Gpu::open(AdapterChoice::Any) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none_or(|value| value != "1"), "{error}");
            eprintln!("skipped: {error}");
            None
        }
    }
}

/// Numbers of every kind: random bit patterns, numbers around 0..1, subnormal numbers, edge cases of the formats, and
/// NaN.
fn numbers(seed: u64) -> Vec<[f32; 4]> {
    let mut state = seed;
    let mut next = || {
        // Vigna's SplitMix64.
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ mixed >> 31) as u32
    };
    let special = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        f32::MIN_POSITIVE,
        f32::MAX,
        f32::MIN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        f32::from_bits(1),
        65_504.0,
        65_519.996,
        65_520.0,
        2.0_f32.powi(-14),
        2.0_f32.powi(-24),
        2.0_f32.powi(-25),
        1.5 * 2.0_f32.powi(-25),
        127.5 / 255.0,
        1.0 + f32::EPSILON,
    ];
    let mut number = || match next() % 8 {
        0 => special[next() as usize % special.len()],
        1 => f32::from_bits(next()),
        2 => f32::from_bits(next() & 0x80ff_ffff),
        // Numbers that are subnormal as 16-bit floats.
        3 => f32::from_bits(0x3300_0000 + next() % 0x0600_0000),
        4 => (next() % 1021) as f32 / 510.0,
        _ => (next() >> 8) as f32 / 16_777_216.0 * 1.2 - 0.1,
    };
    (0..PIXELS).map(|_| std::array::from_fn(|_| number())).collect()
}

fn device(gpu: Gpu, pictures: &[&[[f32; 4]]]) -> (Quads, Lending) {
    let gpu = Arc::new(gpu);
    let lending = Lending::new(Arc::clone(&gpu));
    for (number, pixels) in pictures.iter().enumerate() {
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("a picture of a test"),
            size: wgpu::Extent3d { width: WIDTH, height: HEIGHT, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: PICTURE_USAGE,
            view_formats: &[],
        });
        gpu.fill_texture(&texture, bytemuck::cast_slice(pixels), "a test").expect("uploaded");
        lending.keep(number, texture);
    }
    (Quads::new(&gpu).expect("compiled"), lending)
}

fn quad(formats: [PixelFormat; 2], combines: bool) -> DeviceQuad {
    let source = |number: usize| DeviceSource { place: OnDevice::Made(number), format: formats[number] };
    DeviceQuad { width: WIDTH, height: HEIGHT, color: source(0), factor: combines.then(|| source(1)) }
}

/// The quad as the host fills it.
fn expected(pictures: [&[[f32; 4]]; 2], quad: &DeviceQuad) -> Vec<[f32; 4]> {
    let rounded = |pixels: &[[f32; 4]], format: PixelFormat| {
        let mut pixels = pixels.to_vec();
        format.round(&mut pixels);
        pixels
    };
    let color = rounded(pictures[0], quad.color.format);
    let Some(factor) = quad.factor else { return color };
    let factor = rounded(pictures[1], factor.format);
    color.iter().zip(&factor).map(|(color, factor)| color.map(|value| value * factor[0])).collect()
}

/// The bits of a number; all NaN count as one pattern.
fn bits(value: f32) -> u32 {
    if value.is_nan() { f32::NAN.to_bits() } else { value.to_bits() }
}

/// Fills a quad from lent pictures.
fn filled(
    quads: &mut Quads,
    lending: &Lending,
    quad: &DeviceQuad,
    shown: Shown<'_>,
) -> Result<DeviceQuadStats, BackendError> {
    let color = lent(lending, quad, quad.color)?;
    let factor = quad.factor.map(|factor| lent(lending, quad, factor)).transpose()?;
    quads.fill(&lending.gpu, None, (&color, factor.as_ref()), quad, shown)
}

fn floats(quads: &mut Quads, lending: &Lending, quad: &DeviceQuad) -> (Vec<[f32; 4]>, DeviceQuadStats) {
    let mut pixels = vec![[7.0; 4]; PIXELS];
    let stats = filled(quads, lending, quad, Shown::Floats(&mut pixels)).expect("filled");
    (pixels, stats)
}

fn codes(quads: &mut Quads, lending: &Lending, quad: &DeviceQuad, display: Display) -> Codes {
    let mut pixels = vec![[7; 4]; PIXELS];
    filled(quads, lending, quad, Shown::Codes(display, &mut pixels)).expect("filled");
    Codes { width: WIDTH, height: HEIGHT, pixels }
}

const FORMATS: [PixelFormat; 6] = [
    PixelFormat::Rgba32Float,
    PixelFormat::Rgba16Float,
    PixelFormat::Rgba8Unorm,
    PixelFormat::R8Unorm,
    PixelFormat::R32Float,
    PixelFormat::Rg32Float,
];

#[test]
fn quads_are_the_hosts_bit_by_bit_in_every_format() {
    let Some(gpu) = gpu() else { return };
    let (color, factor) = (numbers(1), numbers(2));
    let (mut quads, lending) = device(gpu, &[&color, &factor]);
    for format in FORMATS {
        for combines in [false, true] {
            let quad = quad([format, format], combines);
            let expected = expected([&color, &factor], &quad);
            let (found, stats) = floats(&mut quads, &lending, &quad);
            let pairs = expected.as_flattened().iter().zip(found.as_flattened());
            let wrong = pairs.clone().filter(|(a, b)| bits(**a) != bits(**b)).count();
            let first = pairs.enumerate().find(|(_, (a, b))| bits(**a) != bits(**b));
            assert_eq!(wrong, 0, "{format:?} {combines}: first {first:?}, of {:?}", first.map(|(i, _)| color[i / 4]));
            assert_eq!(stats.not_finite as usize, count_non_finite(&expected), "{format:?} {combines}");
            assert!(!stats.is_blank);
        }
    }
}

#[test]
fn what_lies_in_buffers_gives_what_textures_give() {
    let Some(gpu) = gpu() else { return };
    let (color, factor) = (numbers(8), numbers(9));
    let (mut quads, lending) = device(gpu, &[&color, &factor]);
    let gpu = &lending.gpu;
    // The pixels do not lie at the beginning of the buffer.
    let buffer = |pixels: &[[f32; 4]]| {
        let bytes = [&[7; 256], bytemuck::cast_slice(pixels)].concat();
        Source::Buffer(gpu.upload_buffer("a test", wgpu::BufferUsages::STORAGE, &bytes).expect("uploaded"), 256)
    };
    let sources = [&color, &factor].map(|pixels| buffer(pixels));
    for combines in [false, true] {
        let quad = quad([PixelFormat::Rgba16Float; 2], combines);
        let (expected, _) = floats(&mut quads, &lending, &quad);
        let textures = [0, 1].map(|number| {
            let place = DeviceSource { place: OnDevice::Made(number), ..quad.color };
            lent(&lending, &quad, place).expect("it is there")
        });
        for (color, factor) in [(&sources[0], &sources[1]), (&textures[0], &sources[1]), (&sources[0], &textures[1])] {
            let mut pixels = vec![[7.0; 4]; PIXELS];
            let factor = combines.then_some(factor);
            quads.fill(gpu, None, (color, factor), &quad, Shown::Floats(&mut pixels)).expect("filled");
            let same = expected.as_flattened().iter().zip(pixels.as_flattened()).all(|(a, b)| bits(*a) == bits(*b));
            assert!(same, "{combines} {:?}", (color, factor));
        }
    }
}

#[test]
fn codes_are_the_hosts_without_a_tone_curve() {
    let Some(gpu) = gpu() else { return };
    let (color, factor) = (numbers(3), numbers(4));
    let (mut quads, lending) = device(gpu, &[&color, &factor]);
    for space in [ColorSpace::Report, ColorSpace::Linear] {
        for exposure in [0.0, 0.7, -3.0, 64.0] {
            for combines in [false, true] {
                let quad = quad([PixelFormat::Rgba32Float; 2], combines);
                let display = Display { exposure, ..Display::of(space) };
                let pixels = expected([&color, &factor], &quad);
                let image = Image { width: WIDTH, height: HEIGHT, pixels };
                let expected = Codes::of(&image, display).expect("made");
                let found = codes(&mut quads, &lending, &quad, display);
                let wrong = expected.pixels.iter().zip(&found.pixels).filter(|(a, b)| a != b).count();
                assert_eq!(wrong, 0, "{display:?} {combines}");
            }
        }
    }
    let (quad, report) = (quad([PixelFormat::Rgba32Float; 2], false), Display::default());
    let linear = codes(&mut quads, &lending, &quad, Display::of(ColorSpace::Linear));
    assert!(codes(&mut quads, &lending, &quad, report) != linear, "control: the comparison can fail");
}

/// A driver's division may be off by 2.5 units in the last place. So where the curve passes near a step, a code may be
/// the neighbouring one.
#[test]
fn codes_after_the_tone_curve_are_the_hosts_or_the_next_ones() {
    let Some(gpu) = gpu() else { return };
    let color = numbers(5);
    let (mut quads, lending) = device(gpu, &[&color]);
    let quad = quad([PixelFormat::Rgba32Float; 2], false);
    let image = Image { width: WIDTH, height: HEIGHT, pixels: color };
    for exposure in [0.0, 2.0] {
        let display = Display { exposure, tone: Tone::Reinhard, ..Display::of(ColorSpace::Linear) };
        let expected = Codes::of(&image, display).expect("made");
        let found = codes(&mut quads, &lending, &quad, display);
        let differ = |(a, b): &(&[u8; 4], &[u8; 4])| a != b;
        let pairs = || expected.pixels.iter().zip(&found.pixels);
        let off = pairs().filter(differ).count();
        println!("{off} of {PIXELS} pixels have another code after the tone curve");
        assert!(off <= PIXELS / 1000, "{off} pixels are off: {:?}", pairs().find(differ));
        let near = pairs().all(|(a, b)| a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1));
        assert!(near, "a code is off by more than one");
        let plain = Display { tone: Tone::None, ..display };
        let others = codes(&mut quads, &lending, &quad, plain);
        assert!(others.pixels.iter().zip(&found.pixels).filter(|(a, b)| a != b).count() > PIXELS / 4, "control");
    }
}

#[test]
fn pictures_of_one_colour_are_told_and_launches_of_a_few_rows_give_the_same() {
    let Some(mut gpu) = gpu() else { return };
    // A launch fills at most five rows of floats.
    gpu.limits.max_storage_buffer_binding_size = u64::from(5 * 16 * WIDTH);
    let mut grey = vec![[0.25, 0.5, 0.0, 1.0]; PIXELS];
    for (index, pixel) in grey.iter_mut().enumerate() {
        // Neither alpha nor the sign of 0 makes colours different.
        (pixel[2], pixel[3]) = (if index % 2 == 0 { 0.0 } else { -0.0 }, index as f32);
    }
    let mut last = grey.clone();
    last[PIXELS - 1][1] = 0.5_f32.next_up();
    let mut none = grey.clone();
    none[700][0] = f32::NAN;
    none[PIXELS - 1][3] = f32::INFINITY;
    let several = numbers(6);
    let pictures = [grey, last, none, several];
    let (mut quads, lending) = device(gpu, &pictures.each_ref().map(Vec::as_slice));
    for (number, picture) in pictures.iter().enumerate() {
        let source = DeviceSource { place: OnDevice::Made(number), format: PixelFormat::Rgba32Float };
        let quad = DeviceQuad { width: WIDTH, height: HEIGHT, color: source, factor: None };
        let (found, stats) = floats(&mut quads, &lending, &quad);
        assert!(found.as_flattened().iter().zip(picture.as_flattened()).all(|(a, b)| bits(*a) == bits(*b)));
        let image = Image { width: WIDTH, height: HEIGHT, pixels: picture.clone() };
        let expected = (image.count_non_finite(), image.is_blank());
        assert_eq!((stats.not_finite as usize, stats.is_blank), expected, "picture {number}");
    }
}

#[test]
fn what_is_not_there_is_an_error_and_so_is_a_lost_device() {
    let Some(gpu) = gpu() else { return };
    let color = numbers(7);
    let (mut quads, lending) = device(gpu, &[&color]);
    let fails_into = |quads: &mut Quads, quad: &DeviceQuad, places: usize| {
        let mut pixels = vec![[0; 4]; places];
        let shown = Shown::Codes(Display::default(), &mut pixels);
        filled(quads, &lending, quad, shown).expect_err("refused").to_string()
    };
    let fails = |quads: &mut Quads, quad: &DeviceQuad| fails_into(quads, quad, PIXELS);
    let known = quad([PixelFormat::Rgba32Float; 2], false);
    let missing = fails(&mut quads, &quad([PixelFormat::Rgba32Float; 2], true));
    assert!(missing.contains("not on the device"), "{missing}");
    let of_another_size = fails(&mut quads, &DeviceQuad { width: WIDTH - 1, ..known });
    assert!(of_another_size.contains("not on the device"), "{of_another_size}");
    let small = fails_into(&mut quads, &known, PIXELS - 1);
    assert!(small.contains("61 x 67 pixels into a place for 4086"), "{small}");
    let drawn = DeviceSource { place: OnDevice::Drawn { value: 1, channel: 0 }, ..known.color };
    assert!(fails(&mut quads, &DeviceQuad { color: drawn, ..known }).contains("not on the device"));
    lending.gpu.device.destroy();
    let lost = fails(&mut quads, &known);
    assert!(lost.contains("`--raster cpu` draws without a GPU"), "{lost}");
}
