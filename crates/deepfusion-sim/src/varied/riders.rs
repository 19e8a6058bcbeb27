//! The people of a view who ride and walk.

use super::EndlessConfig;
use super::built_world::BuiltWorld;
use super::draw::generator;
use crate::riders::Riders;
use crate::scene::SceneObject;
use deepfusion_geometry::Se3;
use rand::Rng;

/// Who rides and walks before the camera of view `index`, among its `vehicles`: nobody in rooms, in garages, on motorways and
/// in worlds that are as `simulate` draws them. The views that have some have the same whatever their share is.
pub(super) fn of_view(
    config: &EndlessConfig,
    index: u64,
    place: &BuiltWorld,
    world_from_cam: &Se3,
    vehicles: &[SceneObject],
) -> Riders {
    let mut rng = generator(config.seed, index, 0xB1CE);
    if !place.people.is_empty() && rng.random::<f64>() < config.riders {
        Riders::before(
            &mut rng,
            &place.world,
            &place.people,
            world_from_cam,
            vehicles,
        )
    } else {
        Riders::default()
    }
}
