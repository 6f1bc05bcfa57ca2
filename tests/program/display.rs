//! `render --display`: the data that a listening viewer receives. The parser of packets below follows tev's description
//! of its protocol, and does not use the crate that writes them. No channel is named `A`, which tev would take for alpha.

use curitiba::pipeline::image::read_image;
use std::collections::HashMap;
use std::io::Read as _;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Output};
use std::thread::JoinHandle;

/// An image in the viewer, and how often its pixels were written.
#[derive(Default)]
struct Shown {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 4]>,
    updates: usize,
    written: usize,
}

struct Packet(Vec<u8>);

impl Packet {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let rest = self.0.split_off(N);
        std::mem::replace(&mut self.0, rest).try_into().expect("so many bytes")
    }

    fn number(&mut self) -> usize {
        u32::from_le_bytes(self.take()) as usize
    }

    fn long(&mut self) -> usize {
        u64::from_le_bytes(self.take()) as usize
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|byte| *byte == 0).expect("texts end with 0");
        let rest = self.0.split_off(end + 1);
        let mut text = std::mem::replace(&mut self.0, rest);
        text.pop();
        String::from_utf8(text).expect("UTF-8")
    }
}

/// Receives packets until the other side disconnects.
fn view(mut stream: TcpStream) -> HashMap<String, Shown> {
    let mut images: HashMap<String, Shown> = HashMap::new();
    let mut length = [0; 4];
    while stream.read_exact(&mut length).is_ok() {
        let mut bytes = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut bytes).expect("a packet is whole");
        let mut packet = Packet(bytes);
        let [kind, _focus] = packet.take();
        let name = packet.text();
        let image = images.entry(name).or_default();
        match kind {
            4 => {
                (image.width, image.height) = (packet.number(), packet.number());
                image.pixels = vec![[f32::NAN; 4]; image.width * image.height];
                let channels: Vec<String> = (0..packet.number()).map(|_| packet.text()).collect();
                assert_eq!(channels, ["R", "G", "B", "W"]);
            }
            6 => {
                let count = packet.number();
                let channels: Vec<String> = (0..count).map(|_| packet.text()).collect();
                assert_eq!(channels, ["R", "G", "B", "W"]);
                let [x, y, width, height] = [(); 4].map(|()| packet.number());
                let offsets: Vec<usize> = (0..count).map(|_| packet.long()).collect();
                let strides: Vec<usize> = (0..count).map(|_| packet.long()).collect();
                let data: Vec<f32> = packet.0.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
                image.updates += usize::from(y == 0);
                image.written += width * height;
                for index in 0..width * height {
                    let place = (y + index / width) * image.width + x + index % width;
                    image.pixels[place] = [0, 1, 2, 3].map(|c: usize| data[offsets[c] + index * strides[c]]);
                }
            }
            other => panic!("packets of kind {other} are not expected"),
        }
    }
    images
}

/// A viewer thread, and its address.
fn viewer() -> (JoinHandle<HashMap<String, Shown>>, String) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("bound").to_string();
    (std::thread::spawn(move || view(listener.accept().expect("a connection").0)), address)
}

fn render(folder: &Path, arguments: &[&str]) -> Output {
    let project = concat!(env!("CARGO_MANIFEST_DIR"), "/xml_projects/SceneSSAO.xml");
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    command.args(["render", project, "--raster", "cpu", "--backend", "cpu", "-o", "out.exr"]).args(arguments);
    command.current_dir(folder).output().expect("the program runs")
}

/// The RGBA pixels of a file.
fn pixels(path: &Path) -> Vec<[f32; 4]> {
    read_image(path).expect("an EXR").image.pixels
}

/// The transfer function of sRGB, from display values to linear light (IEC 61966-2-1).
fn linear(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

#[test]
fn the_viewer_gets_every_channel_and_the_window_in_linear_light() {
    let folder = tempfile::tempdir().expect("a folder");
    let (shown, address) = viewer();
    // Wide enough that a picture takes several packets.
    let done = render(
        folder.path(),
        &["--size", "900x600", "--set", "pass2.samples=1", "--show", "all", "--display", &address],
    );
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let images = shown.join().expect("packets are as they should be");
    let of = |ending: &str| {
        let mut found = images.iter().filter(|(name, _)| name.ends_with(ending));
        found.next().unwrap_or_else(|| panic!("{ending} is not among {:?}", images.keys())).1
    };
    for (ending, file, encoded) in
        [(" window", "out.exr", true), ("::pos", "out.pos.exr", false), ("::norm", "out.norm.exr", false)]
    {
        let (image, wanted) = (of(ending), pixels(&folder.path().join(file)));
        assert_eq!([image.width, image.height], [900, 600]);
        assert_eq!((image.updates, image.written), (1, 900 * 600), "{ending}");
        for (found, wanted) in image.pixels.iter().zip(&wanted) {
            for channel in 0..3 {
                let wanted = if encoded { linear(wanted[channel]) } else { wanted[channel] };
                assert!(
                    (found[channel] - wanted).abs() <= 1e-5 * wanted.abs().max(1.0),
                    "{ending}: {found:?} {wanted}"
                );
            }
        }
    }
}

#[test]
fn accumulated_pictures_are_shown_while_they_get_better() {
    let folder = tempfile::tempdir().expect("a folder");
    let (shown, address) = viewer();
    let done = render(folder.path(), &["--size", "160x120", "--accumulate", "2s", "--display", &address]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let images = shown.join().expect("packets are as they should be");
    let window = images.iter().find(|(name, _)| name.ends_with(" window")).expect("the window").1;
    assert!(window.updates >= 3, "{} pictures in two seconds", window.updates);
    let wanted = pixels(&folder.path().join("out.exr"));
    assert!(
        window.pixels.iter().zip(&wanted).all(|(a, b)| (a[1] - linear(b[1])).abs() < 1e-5),
        "the last is the file's"
    );
}

#[test]
fn a_viewer_that_is_not_there_is_an_error_and_one_that_leaves_is_a_warning() {
    let folder = tempfile::tempdir().expect("a folder");
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("bound").to_string();
    let leaves = std::thread::spawn(move || drop(listener.accept()));
    let done = render(folder.path(), &["--size", "320x240", "--set", "pass2.samples=1", "--display", &address]);
    leaves.join().expect("it leaves");
    let told = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.success() && folder.path().join("out.exr").exists(), "{told}");
    assert_eq!(told.matches("takes no more pictures").count(), 1, "{told}");

    std::fs::remove_file(folder.path().join("out.exr")).expect("a file");
    let done = render(folder.path(), &["--display", &address]);
    let told = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(!done.status.success() && told.contains("start tev") && told.contains(&address), "{told}");
    assert!(!folder.path().join("out.exr").exists());
}
