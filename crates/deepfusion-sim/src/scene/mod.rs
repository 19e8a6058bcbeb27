//! The street and everything on it.

mod buildings;
pub(crate) mod cars;
mod furniture;
mod garage;
mod greenery;
mod lamps;
mod layout;
mod variety;
mod widths;

pub use variety::Variety;

use crate::config::Scene;
use crate::primitive::{Hull, Primitive, Shape, V3};
use crate::road::Road;
use crate::texture::ground::Stretch;
use crate::texture::noise::Noise;
use crate::texture::sky::Sky;
use crate::texture::{Material, Rgb};
use deepfusion_geometry::Se3;
use lamps::Lamps;
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// The class of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ObjectClass {
    /// A car, parked or moving.
    Car,
    /// A lamp post, a sign, a bollard or a box at the roadside.
    Pole,
    /// A tree or a bush.
    Tree,
    /// A house.
    Building,
    /// A hedge, a fence or a garden wall.
    Fence,
    /// A van.
    Van,
    /// A lorry or a bus.
    Truck,
    /// A tram.
    Tram,
    /// Someone on foot.
    Pedestrian,
    /// Someone on a bicycle or a motorbike.
    Cyclist,
    /// A parked bicycle or motorbike.
    Bicycle,
    /// Anything else: furniture, goods, rails, banks.
    Misc,
}

/// An object on the street, with its exact box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneObject {
    /// Identity of the object, constant over frames.
    pub id: u64,
    /// Class of the object.
    pub class: ObjectClass,
    /// Centre of its box and its axes (x forward, y left, z up) in the world, metres.
    pub world_from_object: Se3,
    /// Length, width and height of its box along these axes, metres.
    pub size: [f64; 3],
    /// Velocity over ground in the world's axes, m/s.
    pub velocity: Vector3<f64>,
}

/// The static world.
pub(crate) struct World {
    /// The street.
    pub road: Road,
    /// Stretches of the street.
    pub stretches: Vec<Stretch>,
    /// Index into `stretches` for each sample of the road.
    pub stretch_of: Vec<u16>,
    /// Solids, in order of `s`.
    pub primitives: Vec<Primitive>,
    /// Solids too large to be found by their `s`: hills, halls, bridges. Every camera considers them.
    pub far: Vec<Primitive>,
    /// Position of each of the `primitives` along the street, metres.
    pub along: Vec<f32>,
    /// Convex solids that primitives refer to.
    pub hulls: Vec<Hull>,
    /// Materials of the primitives.
    pub materials: Vec<Material>,
    /// All static objects.
    pub objects: Vec<SceneObject>,
    /// The models of cars, parked and moving.
    pub models: Vec<cars::CarModel>,
    /// Where traffic drives in a varied world: see [`World::lanes`].
    pub lanes: Vec<Lane>,
    /// Rooms of an indoor world.
    pub rooms: Vec<Room>,
    /// Models of people on foot and on wheels, in varied worlds.
    pub crowd: Vec<cars::CarModel>,
    /// The random table of every texture.
    pub noise: Noise,
    /// The sky.
    pub sky: Sky,
    /// Towards the sun, unit length, world axes.
    pub sun: V3,
    /// Irradiance of the sun and of the sky.
    pub light: (Rgb, Rgb),
    /// Lamps that are on.
    pub lamps: Lamps,
    /// The kind of scene.
    pub scene: Scene,
    /// Seed of the drive, folded to 32 bits.
    pub seed: u32,
}

/// A room: a rectangle along the world's axes, and the height of its ceiling. A camera may be anywhere in it that is free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Room {
    /// Least x and y, metres.
    pub low: [f64; 2],
    /// Greatest x and y, metres.
    pub high: [f64; 2],
    /// Height of the ceiling, metres.
    pub height: f64,
}

/// A lane of traffic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lane {
    /// Metres left of the centreline.
    pub lateral: f64,
    /// Whether it leads the way that the camera drives.
    pub forward: bool,
}

impl ObjectClass {
    /// Whether it is a vehicle or a person that can move.
    #[must_use]
    pub fn is_traffic(self) -> bool {
        matches!(
            self,
            Self::Car
                | Self::Van
                | Self::Truck
                | Self::Tram
                | Self::Pedestrian
                | Self::Cyclist
                | Self::Bicycle
        )
    }

    /// Name in a tracklet file: KITTI's for cars, in the same style for the others.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::Car => "Car",
            Self::Pole => "Pole",
            Self::Tree => "Tree",
            Self::Building => "Building",
            Self::Fence => "Fence",
            Self::Van => "Van",
            Self::Truck => "Truck",
            Self::Tram => "Tram",
            Self::Pedestrian => "Pedestrian",
            Self::Cyclist => "Cyclist",
            Self::Bicycle => "Bicycle",
            Self::Misc => "Misc",
        }
    }
}

impl World {
    /// Furnishes `road` for the drive of `seed`.
    #[cfg(test)]
    pub(crate) fn furnish(road: Road, seed: u64, scene: Scene) -> Self {
        Self::furnish_varied(road, seed, scene, &Variety::none())
    }

    /// Furnishes `road` for the drive of `seed`, varied by `variety`.
    pub(crate) fn furnish_varied(road: Road, seed: u64, scene: Scene, variety: &Variety) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x5EED_57AE_E700_0001);
        let azimuth: f32 = rng.random_range(0.0..std::f32::consts::TAU);
        let elevation: f32 = rng.random_range(0.5..1.0);
        let sun = V3::new(
            azimuth.cos() * elevation.cos(),
            azimuth.sin() * elevation.cos(),
            elevation.sin(),
        );
        let clouds = rng.random_range(0.15..0.75);
        let sun_strength = 2.3 - 1.2 * clouds;
        let mut world = Self {
            road,
            stretches: Vec::new(),
            stretch_of: Vec::new(),
            primitives: Vec::new(),
            far: Vec::new(),
            along: Vec::new(),
            hulls: Vec::new(),
            materials: Vec::new(),
            objects: Vec::new(),
            models: Vec::new(),
            lanes: Vec::new(),
            rooms: Vec::new(),
            crowd: Vec::new(),
            noise: Noise::new(seed),
            sky: Sky {
                horizon: Rgb::new(0.72, 0.8, 0.88),
                zenith: Rgb::new(0.16, 0.34, 0.72),
                clouds,
            },
            sun,
            light: (
                Rgb::new(1.0, 0.95, 0.86) * sun_strength,
                Rgb::new(0.62, 0.68, 0.78) * (0.5 + 0.4 * clouds),
            ),
            lamps: Lamps::default(),
            scene,
            seed: (seed ^ (seed >> 32)) as u32,
        };
        world.dim();
        if variety.is_varied() {
            variety::furnish(&mut world, &mut rng, variety);
        } else {
            world.models = cars::models(&mut world, &mut rng);
            match scene {
                Scene::Garage => garage::furnish(&mut world, &mut rng),
                _ => layout::furnish(&mut world, &mut rng),
            }
        }
        world.sort();
        world.lamps.sort();
        world
    }

    /// Models of the people who may ride and walk through it: a varied world's own crowd; for a plain world they are made here.
    pub(crate) fn people(&mut self) -> Vec<cars::CarModel> {
        if self.crowd.is_empty() {
            variety::crowd(self)
        } else {
            self.crowd.clone()
        }
    }

    /// Where traffic drives: the camera's own lane and the one beside it, unless the world has more.
    pub(crate) fn lanes(&self) -> Vec<Lane> {
        if !self.lanes.is_empty() {
            return self.lanes.clone();
        }
        [(-1.65, true), (1.65, false)]
            .map(|(lateral, forward)| Lane { lateral, forward })
            .to_vec()
    }

    /// Removes what hangs lower than `headroom` metres over the camera's lane, for a camera higher than those on most cars.
    pub(crate) fn clear_lane(&mut self, headroom: f64) {
        variety::clear_lane(self, headroom);
        self.sort();
    }

    /// Replaces daylight in scenes that have none.
    fn dim(&mut self) {
        match self.scene {
            Scene::Night => {
                self.sky.horizon = Rgb::new(0.035, 0.033, 0.04);
                self.sky.zenith = Rgb::new(0.006, 0.008, 0.016);
                self.sky.clouds = -1.0;
                self.light = (Rgb::new(0.02, 0.022, 0.03), Rgb::new(0.035, 0.038, 0.05));
            }
            Scene::Garage => self.light = (Rgb::zeros(), Rgb::new(0.09, 0.09, 0.086)),
            Scene::Indoor => self.light = (Rgb::zeros(), Rgb::new(0.3, 0.29, 0.27)),
            _ => {}
        }
    }

    /// Adds a lamp if the scene is dark.
    fn light_lamp(&mut self, place: [f64; 3], strength: Rgb) {
        if self.scene == Scene::Night {
            let s = self.road.locate(place[0], place[1]).s;
            self.lamps.add(s, place, strength);
        }
    }

    /// Sorts the solids along the street, so that a camera can look up those around it.
    fn sort(&mut self) {
        let mut keyed: Vec<(f32, Primitive)> = self
            .primitives
            .iter()
            .map(|p| (self.road.locate(p.position[0], p.position[1]).s, *p))
            .collect();
        keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
        self.along = keyed.iter().map(|k| k.0).collect();
        self.primitives = keyed.into_iter().map(|k| k.1).collect();
    }

    /// Adds a material and returns its index.
    fn material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        (self.materials.len() - 1) as u32
    }

    /// Adds a hull and returns its index.
    fn hull(&mut self, hull: Hull) -> u32 {
        self.hulls.push(hull);
        (self.hulls.len() - 1) as u32
    }

    /// Places a solid.
    fn solid(&mut self, shape: Shape, position: [f64; 3], heading: f64, material: u32, seed: u32) {
        self.primitives.push(Primitive {
            position,
            heading: (heading.cos() as f32, heading.sin() as f32),
            shape,
            material,
            seed,
            moving: false,
        });
    }

    /// Adds a static object; `base` is the middle of its underside.
    fn object(&mut self, class: ObjectClass, base: [f64; 3], heading: f64, size: [f64; 3]) {
        self.objects.push(SceneObject {
            id: self.objects.len() as u64,
            class,
            world_from_object: upright(base, heading, size[2]),
            size,
            velocity: Vector3::zeros(),
        });
    }

    /// Whether a rectangle (half extents along `heading` and across it) keeps `clear` metres from
    /// every kerb.
    fn is_clear(&self, x: f64, y: f64, heading: f64, half: [f64; 2], clear: f32) -> bool {
        let (sin, cos) = heading.sin_cos();
        let steps = |half: f64| ((half / 0.8).ceil() as i32).max(1);
        let (nx, ny) = (steps(half[0]), steps(half[1]));
        (-nx..=nx).all(|i| {
            (-ny..=ny)
                .filter(|j| i.abs() == nx || j.abs() == ny)
                .all(|j| {
                    let u = half[0] * f64::from(i) / f64::from(nx);
                    let v = half[1] * f64::from(j) / f64::from(ny);
                    let p = self
                        .road
                        .locate(x + cos * u - sin * v, y + sin * u + cos * v);
                    self.road.kerb_distance(&p) >= clear
                })
        })
    }
}

/// The pose of an upright box, given the middle of its underside, its heading and its height.
pub(crate) fn upright(base: [f64; 3], heading: f64, height: f64) -> Se3 {
    Se3::from_axis_angle(
        Vector3::new(0.0, 0.0, heading),
        Vector3::new(base[0], base[1], base[2] + 0.5 * height),
    )
}
