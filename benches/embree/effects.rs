//! Whole ray passes: our programs on our tracer, and the same programs on Embree.

use crate::api::Scene;
use crate::flush::Flush;
use crate::scenes::OwnedJob;
use curitiba::passes::cpu::{self, CpuRays};
use curitiba::passes::trace::{Fan, Hit, PACKET, Packet, PacketHits, Ray, Tracer};
use curitiba::pipeline::backend::{RayBackend as _, RayCounts};
use curitiba::pipeline::executor::Progress;
use curitiba::pipeline::image::Image;
use curitiba::pipeline::scene::RenderScene;

/// Embree as the tracer of the programs; fans and packets are traced in packets of sixteen, Embree's best mode.
pub struct Peer<'a>(pub &'a Scene);

fn packet_of(ray: &Ray) -> Packet {
    let mut packet = Packet::new(ray.t_min, ray.t_max);
    packet.set(0, ray.origin, ray.direction);
    packet
}

impl Tracer for Peer<'_> {
    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let _flush = Flush::on();
        self.0.closest(&packet_of(ray), 0, |_, hit| accept(hit))
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        let _flush = Flush::on();
        self.0.occluded(&packet_of(ray), 0, |_, hit| accept(hit))
    }

    fn count_open(&self, fan: &Fan<'_>, mut accept: impl FnMut(&Hit) -> bool) -> u32 {
        let _flush = Flush::on();
        let mut open = 0;
        let mut packet = Packet::new(fan.t_min, fan.t_max);
        for axis in 0..3 {
            packet.origin[axis] = [fan.origin[axis]; PACKET];
        }
        for directions in fan.directions.chunks(PACKET) {
            for (lane, direction) in directions.iter().enumerate() {
                for axis in 0..3 {
                    packet.direction[axis][lane] = direction[axis];
                }
            }
            packet.active = ((1_u32 << directions.len()) - 1) as u16;
            let blocked = self.0.occluded16(&packet, true, |_, hit| accept(hit));
            open += (packet.active & !blocked).count_ones();
        }
        open
    }

    fn closest_packets(
        &self,
        packets: &[Packet],
        hits: &mut [PacketHits],
        mut accept: impl FnMut(usize, &Hit) -> bool,
    ) {
        let _flush = Flush::on();
        for (index, (packet, hits)) in packets.iter().zip(hits).enumerate() {
            *hits = PacketHits::NONE;
            let ask = |lane: usize, hit: &Hit| accept(index * PACKET + lane, hit);
            self.0.closest16(packet, true, ask, |lane, hit| hits.set(lane, &hit));
        }
    }

    fn occluded_packets(&self, packets: &[Packet], blocked: &mut [u16], mut accept: impl FnMut(usize, &Hit) -> bool) {
        let _flush = Flush::on();
        for (index, (packet, blocked)) in packets.iter().zip(blocked).enumerate() {
            *blocked = self.0.occluded16(packet, true, |lane, hit| accept(index * PACKET + lane, hit));
        }
    }
}

/// A picture, and the number of its rays.
pub struct Picture {
    pub image: Image,
    pub rays: RayCounts,
}

fn blank(job: &OwnedJob, scene: &RenderScene) -> Image {
    let job = job.job(scene);
    Image::filled(job.width, job.height, [f32::NAN; 4])
}

/// Runs the ray pass as the program does.
pub fn ours(backend: &mut CpuRays, job: &OwnedJob, scene: &RenderScene, picture: &mut Picture) {
    let stats = backend.run(&job.job(scene), &mut picture.image, &Progress::default()).expect("a complete job");
    picture.rays = stats.rays;
}

/// Runs the same ray pass on Embree.
pub fn theirs(embree: &Scene, job: &OwnedJob, scene: &RenderScene, picture: &mut Picture) {
    let stats = cpu::trace(&Peer(embree), &job.job(scene), &mut picture.image, &Progress::default());
    picture.rays = stats.expect("a complete job").rays;
}

impl Picture {
    pub fn new(job: &OwnedJob, scene: &RenderScene) -> Self {
        Self { image: blank(job, scene), rays: RayCounts::default() }
    }

    /// The number of pixels in which any channel differs in any bit, the number in which one differs by more than 2 of
    /// 255, and the greatest difference.
    pub fn differs(&self, other: &Self) -> (usize, usize, f32) {
        let mut found = (0, 0, 0.0_f32);
        for (a, b) in self.image.pixels.iter().zip(&other.image.pixels) {
            if a != b {
                found.0 += 1;
                let most = a.iter().zip(b).fold(0.0_f32, |most, (a, b)| most.max((a - b).abs()));
                found.1 += usize::from(most > 2.0 / 255.0);
                found.2 = found.2.max(most);
            }
        }
        found
    }
}
