//! `render --display`: sends what passes write to the image viewer tev during rendering.

use super::{Failure, failure};
use curitiba::pipeline::color::{ColorSpace, decode};
use curitiba::pipeline::executor::{Output, Range};
use std::collections::HashMap;
use std::io;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::{Duration, Instant};
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

/// Timeout for the viewer to accept the connection, or to accept a packet.
const PATIENCE: Duration = Duration::from_secs(5);
/// Least time between two pictures of an accumulation.
const PAUSE: Duration = Duration::from_millis(250);
/// Greatest number of floats in a packet, which holds whole rows: 4 MiB, far below the 4 GiB that its length field allows.
const NUMBERS: usize = 1 << 20;
/// The fourth channel is not opacity: in positions it is the light's cosine, and in colours it may be above 1. If it were named `A`, the viewer would
/// take it for opacity, and blend its background with the colours. The viewer shows `W` as a channel group of its own.
const CHANNELS: [&str; 4] = ["R", "G", "B", "W"];

/// A connection to tev. If it breaks, that is reported once, and rendering continues without it.
pub struct Display {
    viewer: Option<TevClient>,
    address: String,
    /// Prefix of the images' names.
    project: String,
    /// Colour space of the colours.
    space: ColorSpace,
    /// Images that the viewer has, with their sizes.
    images: HashMap<String, [u32; 2]>,
    shown: Instant,
}

impl Display {
    /// Connects to a viewer.
    pub fn connect(address: &str, project: String) -> Result<Self, Failure> {
        let connect = || {
            let mut last = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
            for place in address.to_socket_addrs()? {
                match TcpStream::connect_timeout(&place, PATIENCE) {
                    Ok(stream) => return Ok(stream),
                    Err(error) => last = error,
                }
            }
            Err(last)
        };
        let stream = connect().and_then(|stream| stream.set_write_timeout(Some(PATIENCE)).map(|()| stream));
        let stream = stream.map_err(|error| {
            Failure::Usage(format!(
                "--display {address}: {error}; start tev before, which listens at 127.0.0.1:14158 unless its --host says otherwise"
            ))
        })?;
        let (images, shown) = (HashMap::new(), Instant::now());
        Ok(Self {
            viewer: Some(TevClient::wrap(stream)),
            address: address.to_owned(),
            project,
            space: ColorSpace::default(),
            images,
            shown,
        })
    }

    /// Sets the colour space.
    pub fn of(self, space: ColorSpace) -> Self {
        Self { space, ..self }
    }

    /// Whether the next picture of an accumulation is due; if so, [`PAUSE`] begins anew.
    pub fn is_due(&mut self) -> bool {
        let due = self.viewer.is_some() && self.shown.elapsed() >= PAUSE;
        if due {
            self.shown = Instant::now();
        }
        due
    }

    /// Sends a channel. Colours are sent as linear light, since the viewer encodes them for the screen; other values are sent
    /// unchanged.
    pub fn send(&mut self, output: &Output<'_>) {
        let Some(viewer) = &mut self.viewer else { return };
        let name = format!("{} {}", self.project, output.channel);
        let size = [output.width, output.height];
        let encoded = output.range == Range::Color && self.space == ColorSpace::Report;
        let known = self.images.insert(name.clone(), size) == Some(size);
        let mut send = || -> io::Result<()> {
            if !known {
                let [width, height] = size;
                viewer.send(PacketCreateImage {
                    image_name: &name,
                    grab_focus: output.channel == "window",
                    width,
                    height,
                    channel_names: &CHANNELS,
                })?;
            }
            let rows = (NUMBERS / 4 / size[0].max(1) as usize).max(1);
            for (part, pixels) in output.pixels.chunks(rows * size[0] as usize).enumerate() {
                let decoded = |[r, g, b, a]: [f32; 4]| [decode(r), decode(g), decode(b), a];
                let data: Vec<f32> = match encoded {
                    true => pixels.iter().flat_map(|pixel| decoded(*pixel)).collect(),
                    false => pixels.as_flattened().to_vec(),
                };
                viewer.send(PacketUpdateImage {
                    image_name: &name,
                    grab_focus: false,
                    channel_names: &CHANNELS,
                    channel_offsets: &[0, 1, 2, 3],
                    channel_strides: &[4; 4],
                    x: 0,
                    y: (part * rows) as u32,
                    width: size[0],
                    height: (pixels.len() / size[0] as usize) as u32,
                    data: &data,
                })?;
            }
            Ok(())
        };
        if let Err(error) = send() {
            self.viewer = None;
            let address = &self.address;
            failure::print_warning(&format!(
                "the viewer at {address} takes no more pictures ({error}); rendering goes on"
            ));
        }
    }
}
