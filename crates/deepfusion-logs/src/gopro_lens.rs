//! Which of its lenses a GoPro used, as HERO8 and newer write it once into a video's `moov/udta`. The names are those of
//! github.com/gopro/gpmf-parser and of ExifTool's tables.

use crate::error::{Error, Result};
use crate::gpmf::{Entry, entries};
use crate::mp4::{Broken, udta};
use std::path::Path;

/// Lens settings in a GoPro's video.
#[derive(Debug, Clone, PartialEq)]
pub struct GoproLens {
    /// The camera (`MINF`): "HERO11 Black".
    pub model: String,
    /// The digital lens (`VFOV`), a letter: `L` linear, `N` narrow, `W` wide, `S` SuperView, `H` HyperView, `M` max.
    pub digital: char,
    /// Diagonal field of view (`ZFOV`), in degrees.
    pub diagonal_deg: f64,
    /// Width and height of the video as it was recorded (`VRES`), in pixels.
    pub size: (u32, u32),
    /// Whether the picture was zoomed (`DZST` above 0; `DZOM` only says that it could have been).
    pub zoomed: bool,
}

impl GoproLens {
    /// Reads a video's lens settings; `None` if some are missing, as in other cameras' videos and in older or edited ones.
    ///
    /// # Errors
    /// [`Error::File`]; [`Error::Bytes`] for a video that is cut off or damaged.
    pub fn read(video: &Path) -> Result<Option<Self>> {
        let file = std::fs::File::open(video).map_err(|e| Error::file(video, e))?;
        // SAFETY: the file is only read. If it is truncated meanwhile, the system ends the process, as with every mapped file.
        let bytes = unsafe { memmap2::Mmap::map(&file) }.map_err(|e| Error::file(video, e))?;
        Self::find(&bytes).map_err(|broken| broken.of(video))
    }

    fn find(file: &[u8]) -> std::result::Result<Option<Self>, Broken> {
        let Some(range) = udta(file, b"GPMF")? else {
            return Ok(None);
        };
        let mut fields = LensFields::default();
        fields.add(&entries(&file[range.clone()], range.start)?, DEEPEST)?;
        Ok(fields.into_lens())
    }

    /// Whether its pictures are those of a pinhole camera: straight lines stay straight.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        self.digital == 'L'
    }

    /// Focal length of the linear lens in a video of this size, in pixels: half the diagonal over the tangent of half the angle. `None` for
    /// other lenses, for a video that was zoomed or cropped to another shape, and for an impossible angle.
    #[must_use]
    pub fn focal_px(&self, (width, height): (u32, u32)) -> Option<f64> {
        let shape = |(w, h): (u32, u32)| f64::from(w.max(h)) / f64::from(w.min(h).max(1));
        let same_shape = (shape((width, height)) / shape(self.size) - 1.0).abs() < SAME_SHAPE;
        let is_angle = self.diagonal_deg > 0.0 && self.diagonal_deg < 180.0;
        if !(self.is_linear() && same_shape && is_angle) || self.zoomed {
            return None;
        }
        let diagonal = f64::from(width).hypot(f64::from(height));
        Some(diagonal / 2.0 / (self.diagonal_deg / 2.0).to_radians().tan())
    }
}

/// How far a video's aspect ratio may be from the recorded one, as a share: encoders crop sides to multiples of 16.
const SAME_SHAPE: f64 = 0.02;

/// Levels of nested entries: devices, and the streams of one. A damaged file may claim any number.
const DEEPEST: usize = 3;

/// What was found so far.
#[derive(Default)]
struct LensFields {
    model: Option<String>,
    digital: Option<char>,
    diagonal_deg: Option<f64>,
    size: Option<(u32, u32)>,
    zoomed: bool,
}

impl LensFields {
    /// Reads the entries, and those nested in them, `deep` levels down.
    fn add(&mut self, all: &[Entry<'_>], deep: usize) -> std::result::Result<(), Broken> {
        for entry in all {
            match &entry.key {
                b"MINF" => self.model = entry.text(),
                b"VFOV" => self.digital = entry.text().and_then(|text| text.chars().next()),
                b"ZFOV" => self.diagonal_deg = entry.numbers()?.first().copied(),
                b"DZST" => self.zoomed = entry.numbers()?.first().is_some_and(|step| *step > 0.0),
                b"VRES" => {
                    let numbers = entry.numbers()?;
                    if let [width, height, ..] = numbers[..] {
                        self.size = Some((width as u32, height as u32));
                    }
                }
                _ if entry.is_nest() && deep > 0 => {
                    self.add(&entries(entry.value, entry.offset)?, deep - 1)?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn into_lens(self) -> Option<GoproLens> {
        Some(GoproLens {
            model: self.model?,
            digital: self.digital?,
            diagonal_deg: self.diagonal_deg?,
            size: self.size?,
            zoomed: self.zoomed,
        })
    }
}
