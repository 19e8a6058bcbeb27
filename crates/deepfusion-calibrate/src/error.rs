use crate::Board;
use deepfusion_geometry::NoDistortion;
use deepfusion_hint::{Hint, count_of};

/// Why a calibration failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The board is not usable.
    #[error(
        "a board of {}x{} inner corners{}: expected {} to {} corners along each side, and squares above 0 m",
        board.columns, board.rows, board.of_squares(), Board::LEAST, Board::MOST
    )]
    Board {
        /// The board that was given.
        board: Board,
    },
    /// No picture shows the board.
    #[error("no board of {}x{} inner corners found in {}{}", board.columns, board.rows, count_of(*pictures, "picture"), instead(*seen))]
    NoBoard {
        /// The board that was searched for.
        board: Board,
        /// Number of pictures searched.
        pictures: usize,
        /// Columns and rows of the grid that was found most often instead, and the number of pictures with it.
        seen: Option<(usize, usize, usize)>,
    },
    /// Too few pictures show the whole board.
    #[error(
        "the whole board of {}x{} inner corners is in {found} of {}, expected at least {needed}{}",
        board.columns, board.rows, count_of(*pictures, "picture"), instead(*seen)
    )]
    TooFewViews {
        /// The board that was searched for.
        board: Board,
        /// Number of pictures that show it.
        found: usize,
        /// Number of pictures searched.
        pictures: usize,
        /// Number of views that a calibration needs.
        needed: usize,
        /// As in [`Error::NoBoard`].
        seen: Option<(usize, usize, usize)>,
    },
    /// The pictures have different sizes.
    #[error("{picture}: {}x{} pixels, but {}x{} in {first}", size.0, size.1, first_size.0, first_size.1)]
    MixedSizes {
        /// The picture.
        picture: String,
        /// Width and height of the picture.
        size: (u32, u32),
        /// The first picture.
        first: String,
        /// Width and height of the first picture.
        first_size: (u32, u32),
    },
    /// The camera was held differently for some pictures.
    #[error("{picture}: EXIF turns it by {turned}, but {first} by {first_turned}")]
    MixedOrientations {
        /// The picture.
        picture: String,
        /// The rotation that turns it upright, by EXIF.
        turned: &'static str,
        /// The first picture.
        first: String,
        /// The rotation that turns the first picture upright.
        first_turned: &'static str,
    },
    /// A view has another number of corners than the board.
    #[error("{name}: {}, expected the board's {expected}", count_of(*corners, "corner"))]
    Corners {
        /// Name of the view.
        name: String,
        /// Number of its corners.
        corners: usize,
        /// Number of the board's corners.
        expected: usize,
    },
    /// Many cameras explain the views equally well.
    #[error("the views do not determine the camera: {problem}")]
    Undetermined {
        /// What remains open.
        problem: Undetermined,
    },
}

/// What the views do not determine.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Undetermined {
    /// No camera fits the views.
    #[error("no camera explains them")]
    NoCamera,
    /// In the best fit a board is behind the camera.
    #[error("a board would be behind the camera")]
    Behind,
    /// A longer lens farther away fits as well.
    #[error("a longer lens and more distant boards explain them as well")]
    Distance,
    /// The best fit has no valid lens.
    #[error(transparent)]
    Lens(#[from] NoDistortion),
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

fn instead(seen: Option<(usize, usize, usize)>) -> String {
    match seen {
        Some((columns, rows, 1)) => format!("; one of them shows a grid of {columns}x{rows}"),
        Some((columns, rows, n)) => format!("; {n} of them show a grid of {columns}x{rows}"),
        None => String::new(),
    }
}

const INNER: &str = "count inner corners, where four squares meet: a board of 10x7 squares has 9x6";

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        Some(match self {
            Self::Board { .. } => format!("{INNER}; give the side of a square in metres, such as 0.025"),
            Self::NoBoard {
                seen: Some((c, r, _)),
                ..
            }
            | Self::TooFewViews {
                seen: Some((c, r, _)),
                ..
            } => format!("{INNER}; if the detected grid is your board, its size is {c}x{r}"),
            Self::NoBoard { .. } => format!(
                "show the whole board, sharp and evenly lit, with a white margin around it; {INNER}"
            ),
            Self::TooFewViews { .. } => {
                "film the whole board from more sides: sharp, tilted, near, and in every corner of the image".into()
            }
            Self::MixedSizes { .. } => {
                "give pictures of one size, neither zoomed nor cropped: a calibration is for one image size".into()
            }
            Self::MixedOrientations { .. } => {
                "give pictures taken with the camera held one way: turned, its principal point lies elsewhere".into()
            }
            Self::Corners { .. } => "give every corner of the board, row after row".into(),
            Self::Undetermined { .. } => {
                "tilt the board by 20 to 45 degrees, about both of its axes, in half of the views".into()
            }
        })
    }
}
