//! Draws what a network's layers compute: the encoder's features and attention, over the image (the paper's Fig. 5).

use deepfusion_data::{RgbImage, resize_rgb};
use deepfusion_geometry::DepthMap;
use deepfusion_render::{DepthScale, Tile, depth_picture, feature_picture, feature_range, sheet};
use deepfusion_runtime::{FeatureMap, LayerMaps};
use image::imageops::crop_imm;

use crate::Result;

/// Width of each picture of the sheet, in pixels: enough for the captions.
const WIDTH: u32 = 480;

/// The usual names of the encoder's layers.
const LAYERS: [&str; 5] = ["conv1", "layer1", "layer2", "layer3", "layer4"];

/// Image and depth, then for each layer its feature, the feature that the decoder reads, and the spatial mask; without context and
/// attention, only the features.
pub(super) fn picture(
    image: &RgbImage,
    depth: &DepthMap,
    [x, y, width, height]: [u32; 4],
    layers: &[LayerMaps],
) -> Result<RgbImage> {
    let size = (WIDTH, (WIDTH * height).div_ceil(width.max(1)).max(1));
    let seen = |picture: &RgbImage| {
        let window = crop_imm(picture, x, y, width, height).to_image();
        resize_rgb(&window, size.0, size.1)
    };
    let small = seen(image);
    let overlay = |caption: String, map: &FeatureMap, range: [f32; 2]| -> Result<Tile> {
        let shape = (map.width, map.height);
        let picture = feature_picture(&small, &map.values, shape, range)?;
        Ok(Tile::new(caption, picture))
    };
    let attends = layers.iter().any(|layer| layer.attention.is_some());
    let refines = layers.iter().any(|layer| layer.refined.is_some());
    let depth = depth_picture(depth, &DepthScale::default());
    let mut tiles = vec![
        Tile::new("image", small.clone()),
        Tile::new("depth", seen(&depth)),
    ];
    for (name, layer) in LAYERS.iter().zip(layers) {
        let feature = &layer.feature;
        let caption = format!(
            "{name}, 1/{}",
            (image_side(layers) / feature.width.max(1)).max(1)
        );
        tiles.push(overlay(caption, feature, feature_range(&feature.values))?);
        if let Some(refined) = &layer.refined {
            let range = feature_range(&refined.values);
            tiles.push(overlay(format!("{name}, to the decoder"), refined, range)?);
        }
        if let Some((mask, [low, high])) = &layer.attention {
            let range @ [from, to] = feature_range(&mask.values);
            let caption = format!("mask {from:.2} to {to:.2} (channels {low:.2} to {high:.2})");
            tiles.push(overlay(caption, mask, range)?);
        }
    }
    let columns = 1 + usize::from(refines) + usize::from(attends);
    Ok(sheet(&tiles, columns.max(2)))
}

/// The width of the network's input: the first feature has half of it.
fn image_side(layers: &[LayerMaps]) -> usize {
    layers.first().map_or(1, |layer| 2 * layer.feature.width)
}
