//! The people in a view who ride and walk.

use super::EndlessConfig;
use super::built_world::BuiltWorld;
use super::draw::generator;
use crate::riders::Riders;
use crate::scene::SceneObject;
use deepfusion_geometry::Se3;
use rand::Rng;

/// The people who ride and walk ahead of the camera of view `index`, among its `vehicles`. There are none in rooms, in garages, on
/// motorways and in plain worlds. A view that has some has the same ones for every share of such views.
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
