//! Finds a calibration board in pictures and videos, and computes the camera from it.

mod left_out;
mod page;
mod report;
mod warning;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use deepfusion_calibrate::{
    Board, BoardDetection, Calibration, Candidate, Error as BoardError, LEAST_VIEWS, LensModel,
    View, calibrate, find_board, pick, sharpness,
};
use deepfusion_data::{Lens, OpenOptions, load_photo, load_rgb};
use deepfusion_fs::natural_order;
use deepfusion_geometry::Distortion;
use deepfusion_images::is_image;
use deepfusion_video::{VideoFrames, is_video};
use image::GrayImage;
use image::imageops::grayscale;
use rayon::prelude::*;

pub use self::left_out::{LeftOut, LeftOutReason};
pub use self::report::CalibrationReport;
pub use self::warning::BoardWarning;
use self::warning::turned;
use crate::{Error, Result, find_inputs};

/// A video is divided into at most this many parts; the sharpest frame of each is searched.
const PARTS: usize = 200;
const FRAMES_OF_A_PART: usize = 4;
/// Number of pictures in memory at once.
const BATCH: usize = 8;

/// Progress of the search for the board.
#[derive(Debug, Clone, Copy)]
pub enum SearchProgress<'a> {
    /// The search of a video begins; its frames are decoded first.
    Video {
        /// Path of the video.
        file: &'a Path,
        /// Number of frames in the video.
        frames: usize,
    },
    /// Number of pictures, or of parts of a video, searched so far, and of all.
    Done(usize, usize),
}

/// What was found of the board in all pictures.
#[derive(Debug, Default)]
pub struct BoardViews {
    /// The views of the board, in pictures and in frames picked from videos.
    pub views: Vec<View>,
    /// Width and height of all of them.
    pub size: (u32, u32),
    /// Number of pictures and frames that were searched.
    pub looked_at: usize,
    /// Pictures and frames without the whole board.
    pub left_out: Vec<LeftOut>,
    /// Number of frames with the board that were not picked.
    pub not_picked: usize,
    /// The first picture's name, and its orientation by EXIF.
    first: Option<(String, u8)>,
    /// Complete grids of other sizes, and how often each was seen.
    others: BTreeMap<(usize, usize), usize>,
}

/// Searches all inputs for the board (pictures, folders, patterns, videos); keeps at most `most` frames of each video.
///
/// # Errors
/// Inputs that cannot be read, or whose sizes or orientations differ.
pub fn find_views(
    inputs: &[String],
    board: &Board,
    most_frames: usize,
    progress: &mut dyn FnMut(SearchProgress),
) -> Result<BoardViews> {
    let (mut files, mut videos) = (Vec::new(), Vec::new());
    for input in inputs {
        let path = PathBuf::from(input);
        if path.is_dir() {
            files.extend(images_of(&path)?);
        } else if path.exists() && is_video(&path) {
            videos.push(path);
        } else {
            let found = find_inputs(std::slice::from_ref(input), &OpenOptions::default(), |_| ())?;
            files.extend(found.into_iter().map(|i| i.path));
        }
    }
    let mut seen = BoardViews::default();
    seen.add_pictures(&files, board, progress)?;
    for video in &videos {
        seen.add_video(video, board, most_frames, progress)?;
    }
    Ok(seen)
}

/// The pictures of a folder in the natural order of their names.
fn images_of(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| deepfusion_data::Error::file(folder, e))?;
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut images: Vec<_> = paths.filter(|p| is_image(p)).collect();
    if images.is_empty() {
        return Err(Error::NoImages {
            input: folder.display().to_string(),
        });
    }
    images.sort_by(|a, b| natural_order(a, b));
    Ok(images)
}

impl BoardViews {
    /// Checks that there are enough views to calibrate.
    ///
    /// # Errors
    /// [`BoardError::NoBoard`] or [`BoardError::TooFewViews`], with the grid that was seen instead.
    pub fn require_enough(&self, board: &Board) -> Result<()> {
        let (found, pictures, board) = (self.views.len(), self.looked_at, *board);
        if found >= LEAST_VIEWS {
            return Ok(());
        }
        let seen = self.other_grid();
        Err(if found == 0 {
            BoardError::NoBoard {
                board,
                pictures,
                seen,
            }
        } else {
            BoardError::TooFewViews {
                board,
                found,
                pictures,
                needed: LEAST_VIEWS,
                seen,
            }
        }
        .into())
    }

    /// Computes the camera and its lens from the views; [`Self::warnings`] say how accurate they are.
    ///
    /// # Errors
    /// As [`Self::require_enough`] and [`calibrate`]; [`BoardError::Undetermined`] for impossible lens parameters.
    pub fn calibrate(&self, board: &Board, model: LensModel) -> Result<(Calibration, Distortion)> {
        self.require_enough(board)?;
        let found = calibrate(&self.views, board, self.size, model)?;
        let lens = found
            .distortion()
            .map_err(|problem| BoardError::Undetermined {
                problem: problem.into(),
            })?;
        Ok((found, lens))
    }

    /// Warnings about too few or too similar views, about orientation by EXIF, and about a lens that images cannot be corrected with.
    #[must_use]
    pub fn warnings(&self, found: &Calibration, lens: &Distortion) -> Vec<BoardWarning> {
        let of_itself = found.warnings().into_iter();
        let mut warnings: Vec<BoardWarning> = of_itself.map(BoardWarning::from).collect();
        warnings.extend(self.turned());
        if let Err(problem) = Lens::new(found.intrinsics, lens) {
            warnings.push(BoardWarning::NotCorrectable(problem));
        }
        warnings
    }

    fn add_pictures(
        &mut self,
        files: &[PathBuf],
        board: &Board,
        progress: &mut dyn FnMut(SearchProgress),
    ) -> Result<()> {
        for (done, batch) in files.chunks(BATCH).enumerate() {
            let looked: Vec<Result<(GrayImage, u8, BoardDetection)>> = batch
                .par_iter()
                .map(|file| {
                    let photo = load_photo(file)?;
                    let image = grayscale(&photo.image);
                    let detection = find_board(&image, board);
                    Ok((image, photo.orientation, detection))
                })
                .collect();
            for (file, looked) in batch.iter().zip(looked) {
                let (image, orientation, detection) = looked?;
                let name = file.display().to_string();
                self.fits(&name, image.dimensions(), orientation)?;
                self.looked_at += 1;
                match detection {
                    BoardDetection::Board(corners) => self.views.push(View { name, corners }),
                    other => self.leave_out(name, &other, board),
                }
            }
            let done = (done * BATCH + batch.len()).min(files.len());
            progress(SearchProgress::Done(done, files.len()));
        }
        Ok(())
    }

    /// Searches the sharpest frame of each part of a video. Of those with the board, it keeps the most different ones.
    fn add_video(
        &mut self,
        file: &Path,
        board: &Board,
        most: usize,
        progress: &mut dyn FnMut(SearchProgress),
    ) -> Result<()> {
        let folder = file.parent().unwrap_or(Path::new("."));
        let video = VideoFrames::open(file, folder)?;
        let frames = video.count();
        let parts = frames.min(PARTS);
        let name = file.display().to_string();
        progress(SearchProgress::Video { file, frames });
        if frames > 0 {
            // The first call decodes all frames.
            video.frame(0)?;
        }
        let part = |i: usize| (i * frames / parts)..((i + 1) * frames / parts);
        let mut candidates: Vec<(Candidate, String)> = Vec::new();
        let numbers: Vec<usize> = (0..parts).collect();
        for batch in numbers.chunks(BATCH) {
            let looked: Vec<Result<(usize, GrayImage, f64, BoardDetection)>> = batch
                .par_iter()
                .map(|i| {
                    let (number, image, sharp) = sharpest(&video, part(*i))?;
                    let detection = find_board(&image, board);
                    Ok((number, image, sharp, detection))
                })
                .collect();
            for looked in looked {
                let (number, image, sharpness, detection) = looked?;
                let name = format!("{name}, frame {number}");
                self.fits(&name, image.dimensions(), 1)?;
                self.looked_at += 1;
                match detection {
                    BoardDetection::Board(corners) => {
                        let candidate = Candidate { corners, sharpness };
                        candidates.push((candidate, name));
                    }
                    other => self.leave_out(name, &other, board),
                }
            }
            progress(SearchProgress::Done(batch[0] + batch.len(), parts));
        }
        let alone: Vec<Candidate> = candidates.iter().map(|(c, _)| c.clone()).collect();
        let picked = pick(&alone, self.size, most);
        self.not_picked += candidates.len() - picked.len();
        for index in picked {
            let (candidate, name) = &candidates[index];
            self.views.push(View {
                name: name.clone(),
                corners: candidate.corners.clone(),
            });
        }
        Ok(())
    }

    /// Checks that a picture has the size and orientation of the first.
    fn fits(&mut self, name: &str, size: (u32, u32), orientation: u8) -> Result<()> {
        let Some((first, first_orientation)) = &self.first else {
            self.first = Some((name.to_owned(), orientation));
            self.size = size;
            return Ok(());
        };
        let (picture, first) = (name.to_owned(), first.clone());
        if orientation != *first_orientation {
            return Err(BoardError::MixedOrientations {
                picture,
                turned: turned(orientation),
                first,
                first_turned: turned(*first_orientation),
            }
            .into());
        }
        if size != self.size {
            return Err(BoardError::MixedSizes {
                picture,
                size,
                first,
                first_size: self.size,
            }
            .into());
        }
        Ok(())
    }

    fn leave_out(&mut self, name: String, detection: &BoardDetection, board: &Board) {
        let why = match detection {
            BoardDetection::Other {
                columns,
                rows,
                corners,
            } => {
                let (c, r) = (*columns, *rows);
                let longer = board.columns.max(board.rows);
                let shorter = board.columns.min(board.rows);
                if *corners == c * r {
                    *self.others.entry((c, r)).or_default() += 1;
                }
                if corners * 2 < board.corners() {
                    // A fence has some corners, too.
                    LeftOutReason::NoBoard
                } else if c > longer || r > shorter {
                    LeftOutReason::OtherGrid {
                        columns: c,
                        rows: r,
                    }
                } else {
                    LeftOutReason::Incomplete {
                        corners: *corners,
                        of: board.corners(),
                    }
                }
            }
            _ => LeftOutReason::NoBoard,
        };
        self.left_out.push(LeftOut { name, why });
    }

    /// The complete grid of another size that was seen most often: columns, rows, how often.
    #[must_use]
    pub fn other_grid(&self) -> Option<(usize, usize, usize)> {
        let most = self.others.iter().max_by_key(|(_, n)| **n);
        most.map(|((columns, rows), n)| (*columns, *rows, *n))
    }

    /// A warning that pictures were turned upright, so that the calibration is for upright ones.
    fn turned(&self) -> Option<BoardWarning> {
        let (_, orientation) = self.first.as_ref()?;
        (*orientation != 1).then_some(BoardWarning::Turned {
            orientation: *orientation,
            size: self.size,
        })
    }
}

/// The sharpest of a part's frames, its number and its sharpness.
fn sharpest(video: &VideoFrames, part: std::ops::Range<usize>) -> Result<(usize, GrayImage, f64)> {
    let step = part.len().div_ceil(FRAMES_OF_A_PART).max(1);
    let mut best: Option<(usize, GrayImage, f64)> = None;
    for number in part.step_by(step) {
        let image = grayscale(&load_rgb(&video.frame(number as u64)?)?);
        let sharp = sharpness(&image);
        if best.as_ref().is_none_or(|b| b.2 < sharp) {
            best = Some((number, image, sharp));
        }
    }
    // No part is empty. An empty frame would contain no board.
    Ok(best.unwrap_or_default())
}
