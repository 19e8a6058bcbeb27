//! The drives of a configuration are the same in every version: pictures, depths and boxes, byte for byte. So are views of the endless mode
//! whose settings use nothing newer.

use deepfusion_sim::{Endless, EndlessConfig, Scene, Sensors, SimConfig, Simulation};

/// FNV-1a, 64 bits.
fn fold(hash: u64, bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(hash, |h, byte| {
        (h ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Hash of three frames of a drive and of the objects in them.
fn digest(config: &SimConfig) -> u64 {
    let simulation = Simulation::new(config).expect("a valid configuration");
    let mut hash = 0xcbf2_9ce4_8422_2325;
    for index in [0, 7, 13] {
        let frame = simulation.frame(index);
        hash = fold(hash, frame.rgb.as_raw().iter().copied());
        hash = fold(hash, frame.depth.data.iter().flat_map(|d| d.to_le_bytes()));
        for object in simulation.objects(index) {
            hash = fold(hash, object.class.label().bytes());
            hash = fold(hash, object.size.iter().flat_map(|x| x.to_le_bytes()));
        }
    }
    hash
}

/// The hashes were computed before worlds could be varied.
#[test]
fn the_five_scenes_are_unchanged() {
    let known = [
        (Scene::Urban, 1, 0x6cd1_8257_47f6_ee02),
        (Scene::Urban, 2, 0x6e7f_f36d_cd5d_518a),
        (Scene::Park, 1, 0xed05_95e2_33f2_9da1),
        (Scene::Garage, 1, 0xe235_5974_afbf_e5f7),
        (Scene::Commercial, 1, 0x01e5_7452_d315_bb0d),
        (Scene::Night, 1, 0xa41b_2f44_25e0_2778),
    ];
    for (scene, seed, expected) in known {
        let config = SimConfig {
            seed,
            frames: 14,
            width: 208,
            height: 96,
            moving_cars: 4,
            scene,
            sensors: Sensors::Kitti,
            ..SimConfig::default()
        };
        let found = digest(&config);
        assert_eq!(found, expected, "{} {seed}: {found:#018x}", scene.name());
    }
}

/// The hash was computed before views could have hills, and before an ingredient could be left out.
#[test]
fn views_without_hills_are_unchanged() {
    let stream = Endless::new(EndlessConfig {
        width: 160,
        height: 96,
        views_per_world: 2,
        plain: 0.2,
        ..EndlessConfig::default()
    })
    .expect("a valid configuration");
    let mut hash = 0xcbf2_9ce4_8422_2325;
    for index in 0..64 {
        let view = stream.view(index);
        hash = fold(hash, view.rgb.as_raw().iter().copied());
        hash = fold(hash, view.depth.data.iter().flat_map(|d| d.to_le_bytes()));
        hash = fold(hash, view.moving.iter().map(|m| u8::from(*m)));
        hash = fold(hash, view.intrinsics.fy.to_le_bytes());
    }
    assert_eq!(hash, 0xf620_d1b1_f587_d575, "{hash:#018x}");
}
