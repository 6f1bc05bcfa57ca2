//! Glass by the rules of its materials (`glass=auto`), after `docs/glass.md`: light is followed back through bodies, walls and panes.

use super::facets::Facet;
use super::glass::BOUNCE;
use super::job::Traced;
use super::media::{Bodies, Border};
use super::optics::{Interface, Wall, index, interface_normal, mirrored};
use super::points::{Purpose, branch, random};
use super::programs::Sample;
use super::spectrum;
use super::world::Surface;
use curitiba_pipeline::glass::{Dielectric, Shape};
use glam::{DVec2, DVec3};

/// Greatest number of glass surfaces on a path.
const MOST_SURFACES: u32 = 128;
/// Number of facets that a path meets at its first rough surface, along each side of the unit square.
const FACETS: u32 = 2;
/// Number of wavelengths into which a path is divided.
const WAVELENGTHS: u32 = 8;
/// Number of the first branch that is neither the reflected nor the refracted one.
const DIVIDED: u64 = 2;

/// A path that has come to a surface.
#[derive(Debug, Clone)]
struct Path {
    /// The bodies that the path lies in, in front of the surface.
    bodies: Bodies,
    /// Number of glass surfaces met before.
    surfaces: u32,
    /// How often the path was divided in two.
    splits: u32,
    /// The wavelength of its light, nanometres; `None` until a body has dispersed the light.
    wavelength: Option<f64>,
    /// Whether the path has met a rough surface.
    is_scattered: bool,
    /// Upper bound on the path's share of the sample.
    weight: f64,
    key: u64,
}

/// A continuation of a path from a surface.
#[derive(Debug, Clone)]
struct Way {
    direction: DVec3,
    /// Weight of its light, by colour.
    share: DVec3,
    bodies: Bodies,
    /// Number of the branch: 0 where it is reflected.
    branch: u64,
}

/// A part of the light of a path at the surface of a body.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// Weight of its light by colour.
    weight: DVec3,
    wavelength: Option<f64>,
    /// The refractive index behind the surface over the index in front of it.
    ratio: f64,
    /// Number of its branch.
    branch: u64,
}

/// Where the surface of a body sends light: each direction with the share of its light that no other facet blocks.
#[derive(Debug, Clone, Copy)]
struct Onward {
    /// Share that is reflected; the rest enters.
    share: f64,
    back: (DVec3, f64),
    /// `None` at total reflection.
    through: Option<(DVec3, f64)>,
}

impl Sample<'_, '_> {
    /// The colour of glass that the camera sees, by the rules of its material.
    pub(super) fn of_material(&self, pass: &Traced<'_>, surface: &Surface) -> DVec3 {
        let origin = self.ray.origin;
        let path = Path {
            bodies: Bodies::around(self.world, &pass.look, origin),
            surfaces: 0,
            splits: 0,
            wavelength: None,
            is_scattered: false,
            weight: 1.0,
            key: self.key,
        };
        let kept = pass.look.kept_in(&path.bodies, surface.position.distance(origin));
        kept * Walk { sample: self, pass }.glass(surface, self.ray.direction, path)
    }
}

/// Follows paths of a sample.
struct Walk<'s> {
    sample: &'s Sample<'s, 's>,
    pass: &'s Traced<'s>,
}

impl Walk<'_> {
    fn dielectric(&self, surface: &Surface) -> &Dielectric {
        &self.pass.look.dielectrics[surface.material]
    }

    /// The light that a surface of glass sends back along a path with this direction.
    fn glass(&self, surface: &Surface, direction: DVec3, path: Path) -> DVec3 {
        if path.surfaces >= MOST_SURFACES {
            return DVec3::ZERO;
        }
        match self.dielectric(surface).shape {
            Shape::Solid => self.solid(surface, direction, path),
            Shape::Thin => {
                self.over_facets(surface, direction, path, |facet, path| self.thin(surface, direction, facet, path))
            }
            Shape::Pane | Shape::Opaque => self.pane(surface, direction, &path),
        }
    }

    /// The mean of `each` over the facets that a path meets at a surface. At a smooth surface, `each` is called once, without a facet.
    fn over_facets(
        &self,
        surface: &Surface,
        direction: DVec3,
        path: Path,
        each: impl Fn(Option<Facet>, Path) -> DVec3,
    ) -> DVec3 {
        let width = self.pass.look.width(self.sample.world, surface);
        if width <= 0.0 {
            return each(None, path);
        }
        let facet = |point| Some(Facet::seen(width, interface_normal(surface, direction), direction, point));
        let point = |number| random(path.key, Purpose::Facet, self.sample.index * FACETS * FACETS + number);
        if path.is_scattered {
            return each(facet(point(0)), path);
        }
        let count = FACETS * FACETS;
        let of_number = |number: u32| {
            let cell = DVec2::new((number % FACETS).into(), (number / FACETS).into());
            let weight = path.weight / f64::from(count);
            let key = branch(path.key, DIVIDED + u64::from(number));
            let own = Path { is_scattered: true, weight, key, ..path.clone() };
            each(facet((cell + point(number)) / f64::from(FACETS)), own)
        };
        (0..count).map(of_number).sum::<DVec3>() / f64::from(count)
    }

    /// The light from a thin wall, which has two faces.
    fn thin(&self, surface: &Surface, direction: DVec3, facet: Option<Facet>, path: Path) -> DVec3 {
        let (look, dielectric) = (&self.pass.look, self.dielectric(surface));
        let normal = facet.map_or_else(|| interface_normal(surface, direction), |facet| facet.normal);
        let around = look.index_in(path.bodies.fills(look.dielectrics), path.wavelength);
        let face = Interface::of(dielectric, -normal.dot(direction), index(dielectric, None) / around);
        let wall = Wall::new(dielectric, &face);
        let ([back, through], [returned, passed]) = match facet {
            None => ([mirrored(direction, normal), direction], [1.0; 2]),
            Some(facet) => {
                let ways = facet.of_wall(direction);
                let kept = facet.passes(ways[0]);
                let goes = |to: f64, way: DVec3| if facet.side(surface, way) == to { kept } else { 0.0 };
                (ways, [goes(1.0, ways[0]), goes(-1.0, ways[1])])
            }
        };
        let way = |direction, share, branch| Way { direction, share, bodies: path.bodies.clone(), branch };
        let back = way(back, wall.reflected * returned * dielectric.mirrors().as_dvec3(), 0);
        let through = way(through, wall.transmitted * passed * look.filter(self.sample.world, surface), 1);
        self.split(surface, Some(back), Some(through), &path) + self.veil(surface, wall.transmitted, &path)
    }

    /// The light from the report's pane. [`BOUNCE`] dims it at each glass surface after the first one of the path.
    fn pane(&self, surface: &Surface, direction: DVec3, path: &Path) -> DVec3 {
        let onward = self.smooth(surface, direction, f64::from(self.pass.params.index), None);
        let kept = if path.surfaces > 0 { BOUNCE } else { 1.0 };
        let way = |direction, share: f64, branch| Way {
            direction,
            share: DVec3::splat(kept * share),
            bodies: path.bodies.clone(),
            branch,
        };
        let back = way(onward.back.0, onward.share, 0);
        let through = onward.through.map(|(direction, _)| way(direction, 1.0 - onward.share, 1));
        self.split(surface, Some(back), through, path)
    }

    /// The light from the surface of a body.
    fn solid(&self, surface: &Surface, direction: DVec3, path: Path) -> DVec3 {
        let (look, table) = (&self.pass.look, self.pass.look.dielectrics);
        let border = path.bodies.cross(table, surface.material, surface.is_front());
        let straight = |share| Way { direction, share, bodies: border.after.clone(), branch: 1 };
        if !border.is_seen {
            return self.follow(surface, straight(DVec3::ONE), &path, 0);
        }
        let ratio = |wavelength| {
            let [before, behind] = border.sides.map(|side| look.index_in(side, wavelength));
            behind / before
        };
        let spreads = border.sides.iter().flatten().any(|material| table[*material].spread > 0.0);
        let divides = spreads && path.wavelength.is_none() && self.pass.params.wavelengths > 1;
        if !divides && ratio(path.wavelength) == 1.0 {
            let filter = look.filter(self.sample.world, surface);
            return self.follow(surface, straight(filter), &path, 0) + self.veil(surface, DVec3::ONE, &path);
        }
        self.over_facets(surface, direction, path, |facet, path| {
            let part = |weight, wavelength, branch| Part { weight, wavelength, ratio: ratio(wavelength), branch };
            let parts: Vec<Part> = match divides {
                false => vec![part(DVec3::ONE, path.wavelength, 1)],
                true => self.wavelengths(&path, part).collect(),
            };
            self.bent(surface, direction, (facet, &parts, &border), &path)
        })
    }

    /// Divides the light of a path into [`WAVELENGTHS`] parts of one wavelength each, one from each of as many parts of the spectrum with
    /// equal weight.
    fn wavelengths<'p>(
        &self,
        path: &Path,
        part: impl Fn(DVec3, Option<f64>, u64) -> Part + 'p,
    ) -> impl Iterator<Item = Part> + 'p {
        let (key, first) = (path.key, self.sample.index * WAVELENGTHS);
        let count = f64::from(WAVELENGTHS);
        (0..WAVELENGTHS).map(move |number| {
            let at = random(key, Purpose::Wavelength, first + number).x;
            let (wavelength, weight) = spectrum::chosen((f64::from(number) + at) / count);
            part(weight / count, Some(wavelength), DIVIDED + u64::from(FACETS * FACETS + number))
        })
    }

    /// The light from the surface of a body, for these parts of the light. Each part that enters is followed by itself; reflected parts with one
    /// direction are followed together.
    fn bent(
        &self,
        surface: &Surface,
        direction: DVec3,
        (facet, parts, border): (Option<Facet>, &[Part], &Border),
        path: &Path,
    ) -> DVec3 {
        let dielectric = self.dielectric(surface);
        let filter = self.pass.look.filter(self.sample.world, surface);
        let both = path.splits < self.pass.params.depth;
        let (mut color, mut entering, mut splits) = (DVec3::ZERO, DVec3::ZERO, 0);
        let mut back: Vec<Way> = Vec::new();
        for part in parts {
            let onward = self.smooth(surface, direction, part.ratio, Some((dielectric, facet)));
            entering += part.weight * (1.0 - onward.share);
            let mut reflected = part.weight * onward.share * onward.back.1 * dielectric.mirrors().as_dvec3();
            let passed = onward.through.map_or(0.0, |(_, kept)| (1.0 - onward.share) * kept);
            let mut share = part.weight * passed * filter;
            if let Some((direction, _)) = onward.through.filter(|_| share != DVec3::ZERO) {
                let divides = reflected != DVec3::ZERO;
                if !both {
                    // Beyond the depth, the path is not divided: the refracted branch gets the weight of both branches.
                    (reflected, share) = (DVec3::ZERO, share + reflected);
                }
                let own = Path { wavelength: part.wavelength, ..path.clone() };
                let way = Way { direction, share, bodies: border.after.clone(), branch: part.branch };
                let more = u32::from(both && divides);
                color += self.follow(surface, way, &own, more);
                splits |= more;
            }
            match back.iter_mut().find(|way| way.direction == onward.back.0) {
                Some(way) => way.share += reflected,
                None => back.push(Way {
                    direction: onward.back.0,
                    share: reflected,
                    bodies: path.bodies.clone(),
                    branch: 0,
                }),
            }
        }
        for way in back.into_iter().filter(|way| way.share != DVec3::ZERO) {
            color += self.follow(surface, way, path, splits);
        }
        color + self.veil(surface, entering, path)
    }

    /// Where the surface of a body, or of the report's pane, sends light; `ratio` is the index behind it over the index in front of it. Light that
    /// a facet sends to the wrong side is lost.
    fn smooth(
        &self,
        surface: &Surface,
        direction: DVec3,
        ratio: f64,
        material: Option<(&Dielectric, Option<Facet>)>,
    ) -> Onward {
        let bend = |normal: DVec3| {
            let cosine = -normal.dot(direction);
            let interface = match material {
                Some((dielectric, _)) => Interface::of(dielectric, cosine, ratio),
                None => Interface::new(cosine, ratio),
            };
            (normal, interface, interface.refracted(direction, normal, ratio))
        };
        if let Some((_, Some(facet))) = material {
            let (normal, interface, refracted) = bend(facet.normal);
            let back = mirrored(direction, normal);
            let goes = |to: f64, way: DVec3| if facet.side(surface, way) == to { facet.passes(way) } else { 0.0 };
            let through = refracted.map(|way| (way, goes(-1.0, way)));
            return Onward { share: interface.share, back: (back, goes(1.0, back)), through };
        }
        let mut bent = bend(interface_normal(surface, direction));
        if bent.2.is_some_and(|refracted| refracted.dot(surface.facing) >= 0.0) {
            // An interpolated or normal-mapped normal can refract light back to the viewer's side; then the triangle's normal is used.
            bent = bend(surface.facing);
        }
        let (normal, interface, refracted) = bent;
        let back = (mirrored(direction, normal), 1.0);
        Onward { share: interface.share, back, through: refracted.map(|way| (way, 1.0)) }
    }

    /// The part of the entering light that a surface scatters back with its diffuse colour.
    fn veil(&self, surface: &Surface, entering: DVec3, path: &Path) -> DVec3 {
        let look = &self.pass.look;
        let veil = look.veil(self.sample.world, surface);
        if veil <= 0.0 {
            return DVec3::ZERO;
        }
        veil * entering * self.lit(surface, path)
    }

    /// The lit colour of a surface.
    fn lit(&self, surface: &Surface, path: &Path) -> DVec3 {
        let color = self.pass.look.met_color(self.sample.world, surface);
        self.sample.in_light(self.pass, color, surface, (surface.facing, false), (path.weight, path.key))
    }

    /// Follows both branches; beyond the depth, only the branch through the surface, with the weight of both.
    fn split(&self, from: &Surface, back: Option<Way>, through: Option<Way>, path: &Path) -> DVec3 {
        let counts = |way: &Way| way.share != DVec3::ZERO;
        match (back.filter(counts), through.filter(counts)) {
            (Some(back), Some(through)) if path.splits < self.pass.params.depth => {
                self.follow(from, back, path, 1) + self.follow(from, through, path, 1)
            }
            (Some(back), Some(through)) => {
                let share = back.share + through.share;
                self.follow(from, Way { share, ..through }, path, 0)
            }
            (back, through) => back.or(through).map_or(DVec3::ZERO, |way| self.follow(from, way, path, 0)),
        }
    }

    /// What a branch adds to the colour. `splits` is added to the number of divisions of the path.
    fn follow(&self, from: &Surface, way: Way, path: &Path, splits: u32) -> DVec3 {
        let path = Path {
            bodies: way.bodies,
            surfaces: path.surfaces + 1,
            splits: path.splits + splits,
            weight: path.weight * way.share.abs().max_element(),
            key: branch(path.key, way.branch),
            ..*path
        };
        way.share * self.arriving(from, way.direction, path)
    }

    /// The light that arrives at a surface from a direction.
    fn arriving(&self, at: &Surface, direction: DVec3, path: Path) -> DVec3 {
        let (world, look) = (self.sample.world, &self.pass.look);
        let origin = world.leaving(at, direction);
        let Some(hit) = world.closest(look.shades, origin, direction) else {
            return look.kept_in(&path.bodies, f64::INFINITY) * self.pass.beyond;
        };
        let surface = world.surface(look.shades, &hit, (origin, direction));
        let kept = look.kept_in(&path.bodies, surface.position.distance(at.position));
        kept * match look.glass[surface.material] {
            true => self.glass(&surface, direction, path),
            false => self.lit(&surface, &path),
        }
    }
}
