//! How a vehicle turned, according to its own images.
//!
//! A body on springs rolls and pitches by a tenth of a degree from one image to the next. That moves the picture as much as driving one
//! metre moves the road 25 m ahead, and a yaw rate alone does not show it. The points of two images do: the camera's turn follows from
//! them ([`super::epipolar`]), and the vehicle's roll, pitch and yaw from that by the mount.

use super::epipolar::EpipolarPair;
use super::flow::flow;
use super::survey;
use deepfusion_data::{Dataset, Ego, SeenTurn, VehicleMotion, grey_image};
use deepfusion_geometry::Intrinsics;
use deepfusion_motion::GreyImage;
use nalgebra::Rotation3;
use rayon::prelude::*;

/// Number of images in memory at a time.
const AT_ONCE: usize = 64;
/// Yaw above which a pair gives no roll and pitch, radians: the movement of points is linear for small turns only.
const MOST_YAW: f64 = 0.08;
/// Passes over a pair without a measured yaw: its direction of travel depends on the yaw.
const PASSES: usize = 3;

/// Version of the method that finds turns. A change of the method increases it: stored turns are valid for one version only.
pub const SEEN_TURNS_VERSION: u32 = 1;

/// The result of [`seen_turns`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TurnsOfImages {
    /// The turns, in the order of time.
    pub turns: Vec<SeenTurn>,
    /// How many images could not be read. If that was a fault of the disk, another run may find more turns.
    pub unread: usize,
}

/// How the vehicle turned from each image to the next, in order, if enough points show it and the distance driven between them is known.
/// Reads all images.
#[must_use]
pub fn seen_turns(dataset: &Dataset) -> TurnsOfImages {
    let Some(ego) = dataset.ego().ok().map(Ego::level) else {
        return TurnsOfImages::default();
    };
    let count = dataset.frames().len().saturating_sub(1);
    let mut found = Vec::with_capacity(count);
    let mut last = SmallImage::read(dataset, 0);
    let mut unread = usize::from(last.is_none());
    for first in (0..count).step_by(AT_ONCE) {
        let end = (first + AT_ONCE).min(count);
        let read: Vec<_> = (first + 1..end + 1)
            .into_par_iter()
            .map(|index| SmallImage::read(dataset, index))
            .collect();
        let images: Vec<&Option<SmallImage>> = std::iter::once(&last).chain(&read).collect();
        let turns: Vec<_> = (first..end)
            .into_par_iter()
            .filter_map(|earlier| {
                let [a, b] = [earlier, earlier + 1].map(|index| images[index - first].as_ref());
                let [from_s, to_s] = [earlier, earlier + 1].map(|i| dataset.frames()[i].time_s);
                turn(&ego, (from_s?, to_s?), (a?, b?))
            })
            .collect();
        found.extend(turns);
        unread += read.iter().filter(|image| image.is_none()).count();
        last = read.into_iter().next_back().flatten();
    }
    TurnsOfImages {
        turns: found,
        unread,
    }
}

/// An image, small and grey, and its camera.
struct SmallImage {
    image: GreyImage,
    intrinsics: Intrinsics,
}

impl SmallImage {
    /// `None` for an image that cannot be read.
    fn read(dataset: &Dataset, index: usize) -> Option<Self> {
        let k = dataset.intrinsics(index);
        let (width, height) = survey::small_size(&k);
        let image = dataset.load_image(index).ok()?;
        Some(Self {
            image: grey_image(&image, width, height),
            intrinsics: k.resized(width, height),
        })
    }
}

fn turn(
    ego: &Ego<'_>,
    (from_s, to_s): (f64, f64),
    (a, b): (&SmallImage, &SmallImage),
) -> Option<SeenTurn> {
    let mut vehicle = ego.vehicle_motion(from_s, to_s)?;
    let points = flow(&a.image, &b.image);
    let vehicle_from_cam = ego.cam_from_vehicle.inverse();
    let passes = if ego.yaw_known() { 1 } else { PASSES };
    let mut seen = None;
    for _ in 0..passes {
        let measured = vehicle.camera0_from_camera1(&ego.cam_from_vehicle);
        let pair = EpipolarPair::new(&points, &a.intrinsics, measured, (from_s, to_s))?;
        let turn = vehicle_from_cam.rotate(&pair.turn_of_a_pitching_body(&pair.direction()?)?);
        let (roll, pitch, yaw) = Rotation3::from_scaled_axis(turn).euler_angles();
        if !ego.yaw_known() {
            vehicle = VehicleMotion {
                yaw_rad: yaw,
                ..vehicle
            };
        }
        let slight = yaw.abs() < MOST_YAW;
        seen = Some(SeenTurn {
            from_s,
            to_s,
            yaw_rad: yaw,
            tilt_rad: if slight { [roll, pitch] } else { [0.0; 2] },
        });
    }
    seen
}
