//! A varied drive: one camera, one light and one weather for all of its frames, drawn from its seed as for a view.
//!
//! Parts of a view that suit a single image only are left out: hills, which begin ahead of one camera position, and the dense traffic
//! around it, which does not drive anywhere.

use super::built_world::sun;
use super::camera::{self, HEIGHTS, Mount};
use super::config::EndlessConfig;
use super::digits::{in_few_digits, widened};
use super::draw::generator;
use super::formation::{Brightness, Formation};
use super::ingredient::Without;
use super::mounted::MountedCamera;
use super::weather::{self, Weather};
use super::wet;
use crate::config::{Scene, SimConfig};
use crate::light::GroundLight;
use crate::primitive::{Primitive, V3};
use crate::render::{self, Air, Cores, Edges, Folds, Picture, RenderInput};
use crate::rig::{CAMERA_HEIGHT, Rig};
use crate::scene::{SceneObject, Variety, World};
use crate::texture::Rgb;
use deepfusion_geometry::{Intrinsics, Se3};
use image::RgbImage;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// The lower edge of the picture must show the road no farther ahead than this, metres.
const ROAD_WITHIN: f64 = 25.0;

/// Free height above the camera, metres.
const HEADROOM: f64 = 0.4;

/// Greatest height of a camera in garages, metres: the ceiling is at 2.75 m, with pipes and lamps below it.
const HIGHEST_IN_GARAGES: f64 = 2.0;

/// Mountings that are drawn before a level camera at the default height is used.
const TRIES: usize = 60;

/// What a varied drive ([`crate::SimConfig::varied`]) drew from its seed besides its street. It is the same in all frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DrawnDrive {
    /// The camera as mounted on the car: its lens, in pixels of the pictures, its height above the road while the car is level, and its
    /// tilt.
    pub camera: MountedCamera,
    /// The light and the weather.
    pub light: DrawnLight,
    /// How the world is varied.
    pub world: Variety,
    /// Image formation: lens, sensor, processing, file.
    #[serde(serialize_with = "in_few_digits")]
    imaging: Formation,
}

/// The light and the weather of a varied drive. They change only colours, not depth. Light is relative: it has no unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DrawnLight {
    /// The weather.
    pub weather: Weather,
    /// Elevation of the sun (at night of the moon), degrees. None in a garage, which has no sky.
    pub sun_elevation_degrees: Option<f64>,
    /// Azimuth of the sun or moon, degrees from the world's x axis towards y. None in a garage.
    pub sun_azimuth_degrees: Option<f64>,
    /// Relative irradiance of the sun on a surface that faces it: linear red, green, blue.
    pub sun: [f64; 3],
    /// Relative irradiance of the sky, or of a garage's lamps, on the ground: linear red, green, blue.
    pub sky: [f64; 3],
    /// Clouds, −1 (none) to 1; in overcast and fog they only give the cover its structure. None in a garage.
    pub clouds: Option<f64>,
    /// Visibility through fog or haze, metres: contrast falls to 2 % there. None in clear air.
    pub visibility_m: Option<f64>,
    /// Wetness of the ground, 0 to 1.
    pub wetness: f64,
}

impl DrawnDrive {
    /// As JSON, with a final newline.
    pub(crate) fn to_json(&self) -> String {
        format!("{:#}\n", serde_json::json!(self))
    }
}

/// The look of a varied drive.
pub(crate) struct DriveLook {
    drawn: DrawnDrive,
    air: Air,
    seed: u64,
}

impl DriveLook {
    /// The variety of the drive's world.
    pub(crate) fn variety(seed: u64) -> Variety {
        Variety::draw(&mut of_drive(seed, 0xD01))
    }

    /// Draws the look of a drive through a world whose light is not baked yet. Also sets the sun, and clears the lane up to the height of a
    /// high camera.
    pub(crate) fn draw(config: &SimConfig, variety: &Variety, world: &mut World) -> Self {
        let seed = config.seed;
        let (intrinsics, (height, pitch, roll)) = draw_camera(config);
        if config.scene != Scene::Garage {
            world.clear_lane(height + HEADROOM);
        }
        world.sun = sun(&mut of_drive(seed, 0xD03));
        let (weather, air) = weather::draw(&mut of_drive(seed, 0xD04), world);
        let grey = EndlessConfig::default().grey;
        let imaging = Formation::draw(&mut of_drive(seed, 0xD05), Brightness::of(weather), grey);
        let drawn = DrawnDrive {
            camera: MountedCamera {
                intrinsics,
                height_m: Some(height),
                pitch_degrees: pitch.to_degrees(),
                roll_degrees: roll.to_degrees(),
            },
            light: in_numbers(weather, &air, &world.sun),
            world: *variety,
            imaging,
        };
        Self { drawn, air, seed }
    }

    /// What was drawn.
    pub(crate) fn drawn(&self) -> &DrawnDrive {
        &self.drawn
    }

    /// Height of the camera above the road while the car is level, metres.
    pub(crate) fn height_m(&self) -> f64 {
        self.drawn.camera.height_m.unwrap_or(CAMERA_HEIGHT)
    }

    /// The rig with the drawn camera in place of the level one at the same height, and the camera's intrinsics.
    pub(crate) fn mount(&self, level: Rig) -> (Rig, Intrinsics) {
        let camera = &self.drawn.camera;
        let (pitch, roll) = (camera.pitch_degrees, camera.roll_degrees);
        let rig = level.with_camera_turned(pitch.to_radians(), roll.to_radians());
        (rig, camera.intrinsics)
    }

    /// What the camera sees at a frame; `moving` are the solids of `objects`. Each frame has its own noise.
    pub(crate) fn picture(
        &self,
        (world, light): (&World, &GroundLight),
        (moving, objects): (&[Primitive], &[SceneObject]),
        world_from_cam: &Se3,
        frame: usize,
    ) -> Picture {
        let folds = Folds::default();
        let input = RenderInput {
            world,
            light,
            air: &self.air,
            cars: objects,
            world_from_cam,
            intrinsics: &self.drawn.camera.intrinsics,
            folds: &folds,
        };
        let solids = render::gather(world, moving, &world_from_cam.translation(), render::BEHIND);
        let mut exposure = render::expose(&input, solids, Cores::All, Edges::EachRay);
        wet::reflect(&input, &mut exposure);
        Picture {
            rgb: self.develop(&exposure.light, frame),
            depth: exposure.depth,
            moving: exposure.moving,
        }
    }

    /// The image of a frame's light, row by row.
    fn develop(&self, light: &[Rgb], frame: usize) -> RgbImage {
        let k = &self.drawn.camera.intrinsics;
        let mut rng = generator(self.seed, frame as u64, 0xD06);
        let formation = self.drawn.imaging.of_another_picture(&mut rng);
        formation.image(light, k.width as usize, k.height as usize, rng.random())
    }
}

/// The generator for draws that are made once for a drive.
fn of_drive(seed: u64, purpose: u64) -> ChaCha8Rng {
    generator(seed, 0, purpose)
}

/// Draws the lens of a drive's camera, its height above the road (metres), and its pitch and roll (radians). A mounting that shows no road
/// within [`ROAD_WITHIN`], or is too high for the ceiling, is drawn again.
fn draw_camera(config: &SimConfig) -> (Intrinsics, (f64, f64, f64)) {
    let mut rng = of_drive(config.seed, 0xD02);
    let size = (config.width, config.height);
    let intrinsics = camera::lens(&mut rng, size, false).intrinsics(size);
    let mount = Mount {
        mounted: None,
        without: Without(&[]),
    };
    let highest = if config.scene == Scene::Garage {
        HIGHEST_IN_GARAGES
    } else {
        HEIGHTS.1
    };
    let mut draws = std::iter::repeat_with(|| mount.draw(&mut rng, false)).take(TRIES);
    let fits = |(height, pitch, _): &(f64, f64, f64)| {
        *height <= highest && sees_road(&intrinsics, *height, *pitch)
    };
    (
        intrinsics,
        draws.find(fits).unwrap_or((CAMERA_HEIGHT, 0.0, 0.0)),
    )
}

/// Whether a camera at this height (metres) and pitch (radians) sees a level road within [`ROAD_WITHIN`] at the lower edge of its picture.
fn sees_road(k: &Intrinsics, height: f64, pitch: f64) -> bool {
    let lowest = (f64::from(k.height) - 1.0 - k.cy) / k.fy;
    lowest.atan() + pitch > (height / ROAD_WITHIN).atan()
}

/// The light and the weather, in numbers.
fn in_numbers(weather: Weather, air: &Air, sun: &V3) -> DrawnLight {
    let colour = |of: Rgb| [of.x, of.y, of.z].map(widened);
    let of_the_sky = |number: f32| (weather != Weather::Indoor).then(|| widened(number));
    DrawnLight {
        weather,
        sun_elevation_degrees: of_the_sky(sun.z.asin().to_degrees()),
        sun_azimuth_degrees: of_the_sky(sun.y.atan2(sun.x).to_degrees()),
        sun: colour(air.light.0),
        sky: colour(air.light.1),
        clouds: of_the_sky(air.sky.clouds),
        visibility_m: weather::visibility(air).map(widened),
        wetness: widened(air.wet),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::Road;

    fn config(seed: u64) -> SimConfig {
        SimConfig {
            seed,
            varied: true,
            ..SimConfig::default()
        }
    }

    fn look(scene: Scene, seed: u64) -> DriveLook {
        let mut rng = generator(seed, 0, 1);
        let road = Road::generate(&mut rng, -60.0, 100.0);
        let mut world = World::furnish(road, seed, scene);
        let config = SimConfig {
            scene,
            ..config(seed)
        };
        DriveLook::draw(&config, &Variety::none(), &mut world)
    }

    #[test]
    fn cameras_are_within_their_bounds_and_see_the_road() {
        let (mut low, mut tilted, mut wide) = (0, 0, 0);
        for seed in 0..400 {
            let street = config(seed);
            let (k, (height, pitch, roll)) = draw_camera(&street);
            assert_eq!(k.implausible(), None);
            assert_eq!((k.width, k.height), (street.width, street.height));
            assert!((HEIGHTS.0..=HEIGHTS.1).contains(&height), "{height}");
            assert!(sees_road(&k, height, pitch), "{seed}");
            low += usize::from(height < 1.2);
            tilted += usize::from(pitch.abs() > 0.03 || roll.abs() > 0.03);
            wide += usize::from(k.fx < 0.5 * f64::from(k.width));
            let garage = SimConfig {
                scene: Scene::Garage,
                ..street
            };
            assert!(draw_camera(&garage).1.0 <= HIGHEST_IN_GARAGES);
        }
        println!("{low} low, {tilted} tilted, {wide} wide");
        assert!(low > 20 && tilted > 100 && wide > 20);
    }

    #[test]
    fn a_camera_that_looks_up_shows_no_road() {
        let k = Intrinsics::from_hfov(60.0, (640, 192));
        assert!(sees_road(&k, 1.6, 0.0));
        assert!(!sees_road(&k, 1.6, -0.2));
    }

    #[test]
    fn the_lower_edge_may_lie_behind_the_foot_of_the_camera() {
        let k = Intrinsics::from_hfov(110.0, (192, 640));
        let lowest = (639.0 - k.cy) / k.fy;
        assert!(lowest.atan() + 0.26 > std::f64::consts::FRAC_PI_2);
        assert!(sees_road(&k, 1.6, 0.26));
        assert!(!sees_road(&k, 1.6, -1.4));
    }

    #[test]
    fn the_noise_is_each_frames_own() {
        let light: Vec<Rgb> = (0..640 * 192)
            .map(|i| Rgb::new(0.3, 0.3, 0.3) * (0.5 + (i % 640) as f32 / 640.0))
            .collect();
        for seed in 1..4 {
            let look = look(Scene::Urban, seed);
            let first = look.develop(&light, 0);
            assert_eq!(first, look.develop(&light, 0));
            assert_ne!(first, look.develop(&light, 1));
        }
    }

    #[test]
    fn drawn_values_are_in_the_json() {
        let look = look(Scene::Urban, 2);
        let text = look.drawn().to_json();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let height = json["camera"]["height_m"].as_f64().unwrap();
        assert!((height - look.height_m()).abs() < 1e-9);
        assert_eq!(json["light"]["weather"], look.drawn().light.weather.name());
        assert_eq!(json["world"]["varied"], false);
        for part in ["lens", "sensor", "processing", "jpeg_quality"] {
            assert!(json["imaging"].get(part).is_some(), "{part}: {text}");
        }
        assert!(json["imaging"]["lens"].get("shake").is_none());
        assert!(json["light"]["sun_elevation_degrees"].is_f64(), "{text}");
    }

    #[test]
    fn a_garage_has_no_sun() {
        let look = look(Scene::Garage, 2);
        let light = &look.drawn().light;
        assert_eq!(light.weather, Weather::Indoor);
        assert_eq!((light.sun_elevation_degrees, light.clouds), (None, None));
        assert_eq!(light.sun, [0.0; 3]);
        assert!(
            look.drawn()
                .to_json()
                .contains("\"sun_azimuth_degrees\": null")
        );
    }
}
