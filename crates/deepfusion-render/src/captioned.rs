use image::{Rgb, RgbImage, imageops};

use crate::DepthScale;
use crate::depth_picture::with_depth_legend;
use crate::text::{TextSize, draw_text, text_width};

pub(crate) const PAPER: Rgb<u8> = Rgb([24, 24, 27]);
pub(crate) const INK: Rgb<u8> = Rgb([228, 228, 231]);
const GAP: u32 = 6;

/// A picture with its caption.
#[derive(Debug, Clone)]
pub struct Tile {
    /// The caption.
    pub caption: String,
    /// The picture.
    pub picture: RgbImage,
}

impl Tile {
    /// A picture with its caption.
    #[must_use]
    pub fn new(caption: impl Into<String>, picture: RgbImage) -> Self {
        Self {
            caption: caption.into(),
            picture,
        }
    }
}

/// Pictures in rows of `columns` (at least 1), each above its caption; columns are as wide as the widest picture, rows as
/// high as their highest.
#[must_use]
pub fn sheet(tiles: &[Tile], columns: usize) -> RgbImage {
    let columns = columns.clamp(1, tiles.len().max(1));
    let width = tiles.iter().map(|t| t.picture.width()).max().unwrap_or(0);
    let size = TextSize::for_width(width);
    let caption = size.height() + 6;
    let highest = |row: &[Tile]| row.iter().map(|t| t.picture.height()).max().unwrap_or(0);
    let height: u32 = tiles
        .chunks(columns)
        .map(|row| caption + highest(row) + GAP)
        .sum();
    let mut out = RgbImage::from_pixel(columns as u32 * (width + GAP) + GAP, height + GAP, PAPER);
    let mut y = GAP;
    for row in tiles.chunks(columns) {
        for (column, tile) in (0u32..).zip(row) {
            let x = GAP + column * (width + GAP);
            draw_text(&mut out, &tile.caption, (x as i32, y as i32), size, INK);
            imageops::replace(
                &mut out,
                &tile.picture,
                i64::from(x),
                i64::from(y + caption),
            );
        }
        y += caption + highest(row) + GAP;
    }
    out
}

/// Pictures of several models: one row per image, one column per model, equal columns in all rows, with the depth scale's
/// legend below. Captions are cut to their column.
#[must_use]
pub fn model_sheet(rows: &[Vec<Tile>], scale: &DepthScale) -> RgbImage {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |t: &Tile| t.picture.width();
    let widest = rows.iter().flatten().map(width).max().unwrap_or(0);
    let letter = text_width("m", TextSize::for_width(widest)).max(1);
    let most = (widest / letter) as usize;
    let mut tiles: Vec<Tile> = Vec::new();
    for row in rows {
        let cut = |t: &Tile| Tile::new(cut(&t.caption, most), t.picture.clone());
        tiles.extend(row.iter().map(cut));
        // The next row begins below a row that ends early.
        tiles.resize(
            tiles.len().next_multiple_of(columns.max(1)),
            Tile::new("", RgbImage::new(0, 0)),
        );
    }
    with_depth_legend(&sheet(&tiles, columns), scale)
}

/// At most `most` letters; if there are more, the last ones are replaced by dots.
fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let kept: String = text.chars().take(most.saturating_sub(2)).collect();
    format!("{kept}..")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_fill_rows_in_order() {
        let red = RgbImage::from_pixel(30, 10, Rgb([255, 0, 0]));
        let blue = RgbImage::from_pixel(30, 10, Rgb([0, 0, 255]));
        let out = sheet(
            &[
                Tile::new("a", red.clone()),
                Tile::new("b", blue),
                Tile::new("c", red),
            ],
            2,
        );
        assert_eq!(out.dimensions(), (6 + 2 * 36, 6 + 2 * 32));
        assert_eq!(out.get_pixel(8, 25), &Rgb([255, 0, 0]));
        assert_eq!(out.get_pixel(44, 25), &Rgb([0, 0, 255]));
        assert_eq!(out.get_pixel(8, 57), &Rgb([255, 0, 0]));
        assert_eq!(out.get_pixel(44, 57), &PAPER);
        assert_eq!(sheet(&[], 3).dimensions(), (12, 6));
    }

    #[test]
    fn models_keep_their_columns_after_a_short_row() {
        let of = |colour| RgbImage::from_pixel(60, 20, Rgb(colour));
        let (red, blue) = (of([255, 0, 0]), of([0, 0, 255]));
        let rows = [
            vec![Tile::new("a", red.clone())],
            vec![
                Tile::new("b", blue.clone()),
                Tile::new("a very long name of a model", red),
            ],
        ];
        let out = model_sheet(&rows, &DepthScale::default());
        let row = 20 + 16 + 6;
        assert_eq!(out.width(), 6 + 2 * 66);
        assert!(out.height() > 6 + 2 * row, "the legend is below");
        assert_eq!(out.get_pixel(10, 6 + 16 + 5), &Rgb([255, 0, 0]));
        assert_eq!(out.get_pixel(10, 6 + row + 16 + 5), &Rgb([0, 0, 255]));
        assert_eq!(out.get_pixel(80, 6 + row + 16 + 5), &Rgb([255, 0, 0]));
        assert_eq!(cut("abcdef", 4), "ab..");
        let none = model_sheet(&[], &DepthScale::default());
        assert_eq!(none.width(), 12);
    }
}
