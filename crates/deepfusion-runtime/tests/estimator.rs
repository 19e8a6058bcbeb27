//! Tests estimators of one network, on one thread and on several.

use std::error::Error;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Barrier};

use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_hint::Hint;
use deepfusion_images::RgbImage;
use deepfusion_runtime::{
    Augmentation, DepthEstimator, DepthRunner, Error as RuntimeError, FusedRunner, ModelSource,
    Precision, Prediction,
};
use rayon::prelude::*;

type Result<T = ()> = std::result::Result<T, Box<dyn Error>>;

/// A picture with some texture.
fn picture(width: u32, height: u32, seed: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let wave = |k: u32| ((x * k + y * 3 + seed * 17) % 251) as u8;
        image::Rgb([wave(1), wave(2), wave(5)])
    })
}

fn camera(width: u32, height: u32) -> Intrinsics {
    Intrinsics::centred(0.6 * f64::from(width), (width, height))
}

fn tiny() -> Result<DepthEstimator> {
    Ok(DepthEstimator::load("tiny")?)
}

#[test]
fn another_estimator_gives_the_same_bits() -> Result {
    let mut first = tiny()?;
    // Its own size, and one for which a runner is made on demand.
    for (width, height) in [(640, 192), (320, 240)] {
        let (image, k) = (picture(width, height, 1), camera(width, height));
        let expected = first.estimate(&image, Some(&k))?;
        let mut second = first.another()?;
        // The images it saw before have no effect.
        second.estimate(&picture(width, height, 9), Some(&k))?;
        assert_eq!(second.estimate(&image, Some(&k))?, expected);
    }
    Ok(())
}

/// A size that only the second estimator has used is available to the first, too: packing takes time and memory.
#[test]
fn estimators_share_the_packed_weights_of_each_size() -> Result {
    let packed = Arc::new(AtomicUsize::new(0));
    let network = ModelSource::named("tiny".as_ref())?.load(None)?;
    let count = Arc::clone(&packed);
    let mut first = DepthEstimator::of(network, move |config, weights| {
        count.fetch_add(1, Ordering::Relaxed);
        FusedRunner::new(config, weights, Precision::F32)
            .map(|runner| Box::new(runner) as Box<dyn DepthRunner>)
    })?;
    let mut second = first.another()?;
    let (image, k) = (picture(320, 240, 1), camera(320, 240));
    let expected = second.estimate(&image, Some(&k))?;
    assert_eq!(first.estimate(&image, Some(&k))?, expected);
    assert_eq!(first.another()?.estimate(&image, Some(&k))?, expected);
    // The training size, and the size that fits the image.
    assert_eq!(packed.load(Ordering::Relaxed), 2);
    Ok(())
}

/// Both threads pack the size, neither waits for the other, and both then use the first result.
#[test]
fn two_threads_may_pack_a_size_at_once() -> Result {
    let network = ModelSource::named("tiny".as_ref())?.load(None)?;
    let (own, meet) = (network.config.size, Barrier::new(2));
    let mut first = DepthEstimator::of(network, move |config, weights| {
        if config.size != own {
            meet.wait();
        }
        FusedRunner::new(config, weights, Precision::F32)
            .map(|runner| Box::new(runner) as Box<dyn DepthRunner>)
    })?;
    let mut second = first.another()?;
    let (image, k) = (picture(320, 240, 1), camera(320, 240));
    let (one, other) = std::thread::scope(|scope| {
        let other = scope.spawn(|| second.estimate(&image, Some(&k)));
        (first.estimate(&image, Some(&k)), other.join())
    });
    let other = other.map_err(|_| "the other thread panicked")?;
    assert_eq!(one?, other?);
    // A third estimator packs nothing: alone at the barrier it would wait forever.
    first.another()?.estimate(&image, Some(&k))?;
    Ok(())
}

/// Each task of a pool has its own estimator, whose work goes to the same pool. With one estimator behind a lock, a thread that waits for
/// its own parallel work could take another task, which would wait for the lock forever.
#[test]
fn tasks_of_a_pool_may_all_predict() -> Result {
    let first = tiny()?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build()?;
    let k = camera(160, 96);
    let expected: Vec<_> = (0..8)
        .map(|seed| {
            Ok(first
                .another()?
                .estimate(&picture(160, 96, seed), Some(&k))?)
        })
        .collect::<Result<_>>()?;
    let found: Vec<_> = pool.install(|| {
        let tasks = (0..8_u32).into_par_iter().map_init(
            || first.another(),
            |estimator, seed| match estimator {
                Ok(estimator) => estimator.estimate(&picture(160, 96, seed), Some(&k)).ok(),
                Err(_) => None,
            },
        );
        tasks.collect()
    });
    assert!(found.into_iter().eq(expected.into_iter().map(Some)));
    Ok(())
}

#[test]
fn a_reused_buffer_is_overwritten() -> Result {
    let mut estimator = tiny()?;
    let mut depth = DepthMap::empty(3, 5);
    for (width, height) in [(640, 192), (160, 96), (320, 96)] {
        let (image, k) = (picture(width, height, 2), camera(width, height));
        estimator.estimate_into(&image, Some(&k), &mut depth)?;
        let expected = estimator.estimate(&image, Some(&k))?.depth();
        assert_eq!(
            (depth.width, depth.height),
            (width as usize, height as usize)
        );
        assert!(depth.data == expected.data);
        assert!(
            depth
                .data
                .iter()
                .all(|metres| *metres > 0.0 && metres.is_finite())
        );
    }
    Ok(())
}

#[test]
fn an_image_of_another_size_is_refused() -> Result {
    let mut estimator = tiny()?;
    let runner: &mut dyn DepthRunner = estimator.runner();
    let error = runner.disparity(&[0.5; 12]).unwrap_err();
    assert!(
        matches!(error, RuntimeError::ImageSize { found: 12, .. }),
        "{error}"
    );
    assert!(error.hint().is_some());
    Ok(())
}

#[test]
fn an_unknown_name_is_refused_with_the_known_ones() {
    let error = ModelSource::named(Path::new("no-such-network")).unwrap_err();
    assert!(error.to_string().contains("no-such-network"), "{error}");
    assert!(error.hint().is_some_and(|hint| hint.contains("street")));
    // A folder that is not a run.
    let folder = tempfile::tempdir().unwrap();
    let error = DepthEstimator::load(folder.path()).unwrap_err();
    assert!(error.hint().is_some(), "{error}");
}

/// Test-time augmentation.
fn augmented(
    estimator: &mut DepthEstimator,
    image: &RgbImage,
    how: Augmentation,
) -> Result<Prediction> {
    let preparer = estimator.augmented(how)?;
    let k = camera(image.width(), image.height());
    Ok(estimator.infer(&preparer.prepare(image, Some(&k), true, true))?)
}

#[test]
fn several_predictions_give_their_mean() -> Result {
    let mut estimator = tiny()?;
    let image = picture(640, 480, 4);
    let at = |estimator: &mut DepthEstimator, scales| {
        let how = Augmentation {
            scales,
            ..Augmentation::NONE
        };
        augmented(estimator, &image, how)
    };
    let small = at(&mut estimator, &[0.8])?;
    let large = at(&mut estimator, &[1.2])?;
    let both = augmented(&mut estimator, &image, Augmentation::MULTI_SCALE)?;
    let size = |of: &Prediction| (of.width, of.height);
    assert_eq!(
        [&small, &large, &both].map(size),
        [(160, 128), (256, 192), (256, 192)]
    );
    assert_eq!(both.focal_factor, large.focal_factor);
    // Metric disparity at the image's size: enlarging is linear, so inside the image the order of means does not matter.
    let inverse = |of: &Prediction| of.depth().data.iter().map(|d| 1.0 / d).collect::<Vec<_>>();
    let [small, large, both] = [&small, &large, &both].map(inverse);
    let mut farthest = 0.0_f32;
    for ((a, b), mean) in small.iter().zip(&large).zip(&both) {
        farthest = farthest.max(((a + b) / 2.0 / mean - 1.0).abs());
    }
    // The effect of resampling edges twice.
    assert!(farthest < 0.2, "{farthest}");
    let mean = |of: &[f32]| of.iter().sum::<f32>() / of.len() as f32;
    let ratio = (mean(&small) + mean(&large)) / 2.0 / mean(&both);
    assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
    assert!((mean(&small) / mean(&large) - 1.0).abs() > 0.01);
    Ok(())
}

/// With the mirrored image among the predictions, the depth of a mirrored image is the mirrored depth.
#[test]
fn a_mirrored_image_has_a_mirrored_depth() -> Result {
    let mut estimator = DepthEstimator::load("street")?;
    let image = picture(640, 192, 6);
    let mirrored = image::imageops::flip_horizontal(&image);
    for how in [Augmentation::FLIP, Augmentation::MULTI_SCALE_FLIP] {
        let own = augmented(&mut estimator, &image, how)?;
        let mut other = augmented(&mut estimator, &mirrored, how)?;
        let scale = other.log_scale.as_mut().ok_or("no ln b")?;
        for values in [&mut other.disparity, scale] {
            for row in values.chunks_exact_mut(own.width) {
                row.reverse();
            }
        }
        for (a, b) in own.disparity.iter().zip(&other.disparity) {
            assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
        }
        for (a, b) in own
            .log_scale
            .iter()
            .flatten()
            .zip(other.log_scale.iter().flatten())
        {
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
    }
    let plain = augmented(&mut estimator, &image, Augmentation::NONE)?;
    assert_eq!(plain, estimator.estimate(&image, Some(&camera(640, 192)))?);
    Ok(())
}

/// Equal to the prediction of the mirrored picture, up to rounding when resizing.
#[test]
fn a_mirrored_prediction_is_mirrored_back() -> Result {
    let mut estimator = DepthEstimator::load("street")?;
    let image = picture(640, 192, 7);
    let k = camera(640, 192);
    let prepared = estimator.preparer().prepare(&image, Some(&k), true, false);
    let back = estimator.infer_mirrored(&prepared)?;
    let mirrored = image::imageops::flip_horizontal(&image);
    let mut expected = estimator.predict(&mirrored, Some(&k.flipped()), true, false)?;
    assert_eq!((back.width, back.window), (expected.width, expected.window));
    let scale = expected.log_scale.as_mut().ok_or("no ln b")?;
    for values in [&mut expected.disparity, scale] {
        for row in values.chunks_exact_mut(back.width) {
            row.reverse();
        }
    }
    let differ = |other: &Prediction| -> [f32; 2] {
        let pairs = back.disparity.iter().zip(&other.disparity);
        let disparity = pairs.map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f32::max);
        let other = other.log_scale.iter().flatten();
        let pairs = back.log_scale.iter().flatten().zip(other);
        [
            disparity,
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max),
        ]
    };
    let (off, own) = (differ(&expected), differ(&estimator.infer(&prepared)?));
    assert!(off.iter().all(|off| *off < 0.01), "{off:?}");
    assert!(own.iter().all(|own| *own > 0.01), "{own:?}");
    Ok(())
}

#[test]
fn a_network_of_one_camera_has_one_size() -> Result {
    let mut network = ModelSource::named(Path::new("tiny"))?.load(None)?;
    network.config.canonical_focal_px = None;
    let mut estimator = DepthEstimator::fused(network, Precision::F32)?;
    let refused = estimator.augmented(Augmentation::MULTI_SCALE).unwrap_err();
    assert!(matches!(refused, RuntimeError::OneSize), "{refused}");
    assert!(refused.hint().is_some_and(|hint| hint.contains("flip")));
    let seen = augmented(&mut estimator, &picture(320, 96, 1), Augmentation::FLIP)?;
    assert_eq!((seen.width, seen.height), (320, 96));
    Ok(())
}
