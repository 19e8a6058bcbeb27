use super::ConvShape;

/// Bytes of unfolded input that a tile may take: it should stay in the cache between being written
/// and being multiplied.
const TILE_BYTES: usize = 1 << 20;

/// Columns below which a matrix product no longer pays for reading the weights.
const MIN_COLUMNS: usize = 192;

/// Consecutive output rows, counted over all images: global row `n * out_height + y`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Tile {
    pub(crate) first_row: usize,
    pub(crate) rows: usize,
}

/// The part of a tile that lies in one image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Piece {
    pub(crate) image: usize,
    /// First output row within the image.
    pub(crate) y: usize,
    pub(crate) rows: usize,
    /// First column of this piece within the tile.
    pub(crate) column: usize,
}

impl Tile {
    pub(crate) fn columns(&self, shape: &ConvShape) -> usize {
        self.rows * shape.out_width()
    }

    /// The tile cut at image borders.
    pub(crate) fn pieces(self, shape: &ConvShape) -> impl Iterator<Item = Piece> {
        let (out_height, out_width) = (shape.out_height(), shape.out_width());
        let mut row = self.first_row;
        let end = self.first_row + self.rows;
        std::iter::from_fn(move || {
            (row < end).then(|| {
                let (image, y) = (row / out_height, row % out_height);
                let rows = (out_height - y).min(end - row);
                let column = (row - self.first_row) * out_width;
                row += rows;
                Piece {
                    image,
                    y,
                    rows,
                    column,
                }
            })
        })
    }
}

/// Cuts the rows of images `first..last` into tiles for a matrix of `taps` rows.
///
/// A tile either lies within one image or holds whole images: then its output is either written in
/// place or scattered image by image.
pub(crate) fn tiles(shape: &ConvShape, taps: usize, first: usize, last: usize) -> Vec<Tile> {
    let (out_height, out_width) = (shape.out_height(), shape.out_width());
    let wanted = (TILE_BYTES / (4 * taps)).max(MIN_COLUMNS);
    let mut tiles = Vec::new();
    if out_height * out_width * 2 <= wanted {
        let images = (wanted / (out_height * out_width)).min(last - first);
        for image in (first..last).step_by(images.max(1)) {
            let count = images.min(last - image);
            tiles.push(Tile {
                first_row: image * out_height,
                rows: count * out_height,
            });
        }
    } else {
        // Equal tiles: a last one of a single row would waste most of a matrix product.
        let per_image = out_height.div_ceil((wanted / out_width).max(1));
        let rows = out_height.div_ceil(per_image);
        for image in first..last {
            for y in (0..out_height).step_by(rows) {
                tiles.push(Tile {
                    first_row: image * out_height + y,
                    rows: rows.min(out_height - y),
                });
            }
        }
    }
    tiles
}
