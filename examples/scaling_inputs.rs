//! Writes the inputs for measurements of loading: an OBJ file of many triangles and a scene of many textures, each with a
//! project that ray-traces it.
//!
//! ```text
//! cargo run --release --example scaling_inputs -- FOLDER [TRIANGLES [TEXTURES [SIDE]]]
//! ```
//!
//! The defaults are ten million triangles, 48 textures and 2048 texels a side. The same arguments write the same bytes on
//! every machine. Afterwards:
//!
//! ```text
//! curitiba bench FOLDER/triangles.xml FOLDER/textures.xml --size 256x256 --frames 1 --warmup 0 --sweep-threads 1,2,4,8,16
//! ```

use image::{Rgb, RgbImage};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn main() -> Outcome {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let Some(folder) = words.first() else {
        return Err("usage: scaling_inputs FOLDER [TRIANGLES [TEXTURES [SIDE]]]".into());
    };
    let number = |index: usize, usual: u32| words.get(index).map_or(Ok(usual), |word| word.parse());
    let (triangles, textures, side) = (number(1, 10_000_000)?, number(2, 48)?, number(3, 2048)?);
    let folder = Path::new(folder);
    std::fs::create_dir_all(folder)?;
    write_triangles(folder, triangles)?;
    write_textures(folder, textures, side)?;
    Ok(())
}

/// A hilly ground of about `triangles` triangles without normals and texture coordinates, as scanners write it, and four
/// walls of quads with negative indices and a material of their own.
fn write_triangles(folder: &Path, triangles: u32) -> Outcome {
    let side = ((f64::from(triangles) / 2.0).sqrt() as u32).max(2);
    let mut file = BufWriter::new(File::create(folder.join("triangles.obj"))?);
    writeln!(file, "mtllib triangles.mtl\no ground\nusemtl ground")?;
    let place = |step: u32| f64::from(step) / f64::from(side) * 20.0 - 10.0;
    let height = |x: f64, z: f64| (x * 1.3).sin() * (z * 0.9).cos() + 0.05 * (x * 17.0).sin() * (z * 23.0).sin();
    for row in 0..=side {
        for column in 0..=side {
            let (x, z) = (place(column), place(row));
            writeln!(file, "v {x:.6} {:.6} {z:.6}", height(x, z))?;
        }
    }
    for row in 0..side {
        for column in 0..side {
            let first = u64::from(row) * u64::from(side + 1) + u64::from(column) + 1;
            let [below, right] = [first + u64::from(side) + 1, first + 1];
            writeln!(file, "f {first} {below} {right}\nf {right} {below} {}", below + 1)?;
        }
    }
    writeln!(file, "o walls\nusemtl walls")?;
    for [a, b] in [[[-9, -9], [9, -9]], [[9, -9], [9, 9]], [[9, 9], [-9, 9]], [[-9, 9], [-9, -9]]] {
        for ([x, z], y) in [(a, -2), (b, -2), (b, 3), (a, 3)] {
            writeln!(file, "v {x} {y} {z}")?;
        }
        writeln!(file, "f -4 -3 -2 -1")?;
    }
    file.flush()?;
    std::fs::write(folder.join("triangles.mtl"), "newmtl ground\nKd 0.5 0.6 0.4\nnewmtl walls\nKd 0.7 0.5 0.4\n")?;
    write_project(folder, "triangles", [[0.0, 6.0, -13.0], [0.0, -0.4, 0.9]])
}

/// A wall of panels, each with its own texture: PNG files of noise, which hardly compress.
fn write_textures(folder: &Path, count: u32, side: u32) -> Outcome {
    let (mut obj, mut mtl) = ("mtllib textures.mtl\n".to_owned(), String::new());
    let across = f64::from(count).sqrt().ceil() as u32;
    for index in 0..count {
        let mut state = index.wrapping_mul(0x9e37_79b9) | 1;
        let image = RgbImage::from_fn(side, side, |x, y| {
            // xorshift (Marsaglia, 2003): a little noise on a pattern.
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            let noise = |shift: u32| (state >> shift & 15) as u8;
            let checker = if (x / 64 + y / 64) % 2 == 0 { 160 } else { 80 };
            Rgb([checker + noise(0), 60 + (x * 128 / side) as u8 + noise(4), 60 + (y * 128 / side) as u8 + noise(8)])
        });
        image.save(folder.join(format!("texture_{index}.png")))?;
        writeln!(mtl, "newmtl panel_{index}\nKd 1 1 1\nmap_Kd texture_{index}.png")?;
        let [left, low] = [index % across, index / across].map(|step| f64::from(step) * 2.0 - f64::from(across));
        for [x, y] in [[0.0, 0.0], [1.9, 0.0], [1.9, 1.9], [0.0, 1.9]] {
            writeln!(obj, "v {} {} 0\nvt {} {}", left + x, low + y, x / 1.9, y / 1.9)?;
        }
        writeln!(obj, "usemtl panel_{index}\nf -4/-4 -3/-3 -2/-2 -1/-1")?;
    }
    std::fs::write(folder.join("textures.obj"), obj)?;
    std::fs::write(folder.join("textures.mtl"), mtl)?;
    write_project(folder, "textures", [[0.0, 0.0, 14.0], [0.0, 0.0, -1.0]])
}

/// The report's project of shadows with another scene, seen by a camera at `position` that looks along `view`.
fn write_project(folder: &Path, name: &str, [position, view]: [[f64; 3]; 2]) -> Outcome {
    const PROJECT: &str = include_str!("../xml_projects/SceneShadows.xml");
    const LIBRARIES: [(&str, &str); 2] = [
        ("DeferredRenderTargets.mlib", include_str!("../xml_projects/mlibs/DeferredRenderTargets.mlib")),
        ("optixTest.mlib", include_str!("../xml_projects/mlibs/optixTest.mlib")),
    ];
    let place = |tag: &str, [x, y, z]: [f64; 3]| format!("<{tag} x=\"{x}\" y=\"{y}\" z=\"{z}\"/>");
    let changes = [
        ("3dsmodels\\largoCamoes.cbo", format!("{name}.obj")),
        ("<position x=\"7.42\" y=\"18.61\" z=\"-38.62\"/>", place("position", position)),
        ("<view x=\"0.31\" y=\"-0.36\" z=\"0.87\"/>", place("view", view)),
    ];
    let mut project = PROJECT.to_owned();
    for (written, wanted) in changes {
        if !project.contains(written) {
            return Err(format!("SceneShadows.xml has no `{written}` any more").into());
        }
        project = project.replacen(written, &wanted, 1);
    }
    std::fs::create_dir_all(folder.join("mlibs"))?;
    for (library, text) in LIBRARIES {
        std::fs::write(folder.join("mlibs").join(library), text)?;
    }
    std::fs::write(folder.join(format!("{name}.xml")), project)?;
    Ok(())
}
