//! Phones whose main camera's field of view is published, for pictures whose EXIF block names the phone and the lens, but not the
//! focal length in 35 mm film.

/// Diagonal of a frame of 35 mm film, 36 mm by 24 mm, to which EXIF's equivalent focal lengths refer (CIPA DC-008).
pub(super) const FILM_DIAGONAL_MM: f64 = 43.266_615_305_567_87;

/// Makers of action cameras, as EXIF names them. Their EXIF block has a focal length, but not the chosen digital lens, and
/// the wide ones are not pinholes.
const ACTION_CAMERA_MAKERS: [&str; 1] = ["GoPro"];

/// Whether a picture's maker makes action cameras.
pub(super) fn is_action_camera(make: &str) -> bool {
    let named = |maker: &&str| make.eq_ignore_ascii_case(maker);
    ACTION_CAMERA_MAKERS.iter().any(named)
}

/// How far EXIF's focal length may be from the main lens's, as a share: other lenses of the same phone differ by more.
const SAME_LENS: f64 = 0.03;

/// Field of view of a main camera.
#[derive(Debug, Clone, Copy, PartialEq)]
enum View {
    /// Focal length in 35 mm film, in mm, as Apple publishes it.
    FilmMm(f64),
    /// Diagonal field of view, in degrees, as Google and Samsung publish it.
    DiagonalDeg(f64),
}

/// A phone's main camera, with a sensor of 4:3.
#[derive(Debug, PartialEq)]
pub(super) struct KnownCamera {
    make: &'static str,
    /// EXIF's model: the whole, or its beginning if the maker adds a letter per region.
    models: &'static [&'static str],
    exact_model: bool,
    /// The lens's own focal length, in mm, as in EXIF: it distinguishes the main camera from the others.
    lens_mm: f64,
    view: View,
}

const fn apple(models: &'static [&'static str], lens_mm: f64, film_mm: f64) -> KnownCamera {
    KnownCamera {
        make: "Apple",
        models,
        exact_model: true,
        lens_mm,
        view: View::FilmMm(film_mm),
    }
}

const fn google(models: &'static [&'static str], lens_mm: f64) -> KnownCamera {
    KnownCamera {
        make: "Google",
        models,
        exact_model: true,
        lens_mm,
        view: View::DiagonalDeg(82.0),
    }
}

const fn samsung(models: &'static [&'static str], lens_mm: f64, diagonal_deg: f64) -> KnownCamera {
    KnownCamera {
        make: "samsung",
        models,
        exact_model: false,
        lens_mm,
        view: View::DiagonalDeg(diagonal_deg),
    }
}

/// Fields of view as the makers publish them: Apple's technical specifications ("26 mm, ƒ/1.6"; support.apple.com/specs), Google's
/// ("82° field of view"; support.google.com/pixelphone/answer/7158570), Samsung's ("FOV 85°"; the models' specifications on
/// samsung.com). The lenses' own focal lengths are those that the phones write into EXIF. They could not be tested with a picture of each
/// phone. If EXIF's lens is not the one here, the table is not used, so a wrong row is an unused one. Left out: the Galaxy S21 and S21+,
/// whose two longer lenses are too similar to tell apart, and action cameras, whose photographs only name the maker
/// ([`is_action_camera`]); their videos contain more ([`deepfusion_logs::GoproLens`]).
const KNOWN: &[KnownCamera] = &[
    apple(
        &["iPhone 11", "iPhone 11 Pro", "iPhone 11 Pro Max"],
        4.25,
        26.0,
    ),
    apple(&["iPhone 12", "iPhone 12 mini", "iPhone 12 Pro"], 4.2, 26.0),
    apple(
        &["iPhone 12 Pro Max", "iPhone 13", "iPhone 13 mini"],
        5.1,
        26.0,
    ),
    apple(&["iPhone 13 Pro", "iPhone 13 Pro Max"], 5.7, 26.0),
    apple(&["iPhone 14", "iPhone 14 Plus"], 5.7, 26.0),
    apple(&["iPhone 14 Pro", "iPhone 14 Pro Max"], 6.86, 24.0),
    apple(&["iPhone 15", "iPhone 15 Plus"], 5.96, 26.0),
    apple(&["iPhone 15 Pro", "iPhone 15 Pro Max"], 6.765, 24.0),
    google(&["Pixel 6", "Pixel 6 Pro", "Pixel 7", "Pixel 7 Pro"], 6.81),
    google(&["Pixel 8", "Pixel 8 Pro"], 6.9),
    samsung(&["SM-G998"], 6.7, 83.0),
    samsung(&["SM-S901", "SM-S906", "SM-S911", "SM-S916"], 5.4, 85.0),
    samsung(&["SM-S908"], 6.4, 85.0),
    samsung(&["SM-S918"], 6.3, 85.0),
];

impl KnownCamera {
    /// The row for EXIF's make, model and focal length in mm.
    pub(super) fn find(make: &str, model: &str, lens_mm: f64) -> Option<&'static Self> {
        KNOWN.iter().find(|known| {
            let named = |name: &&str| {
                if known.exact_model {
                    model.eq_ignore_ascii_case(name)
                } else {
                    model.starts_with(*name)
                }
            };
            make.eq_ignore_ascii_case(known.make)
                && known.models.iter().any(named)
                && (lens_mm / known.lens_mm - 1.0).abs() < SAME_LENS
        })
    }

    /// Focal length in 35 mm film, from the diagonal, in mm.
    pub(super) fn film_mm(&self) -> f64 {
        match self.view {
            View::FilmMm(mm) => mm,
            View::DiagonalDeg(angle) => FILM_DIAGONAL_MM / 2.0 / (angle / 2.0).to_radians().tan(),
        }
    }

    /// Focal length in pixels of a picture of this size. Pictures with another shape than 4:3 are cropped from the whole sensor's: wider
    /// ones keep its long side, narrower ones its short one.
    pub(super) fn focal_px(&self, (width, height): (u32, u32)) -> f64 {
        let (long, short) = (f64::from(width.max(height)), f64::from(width.min(height)));
        let diagonal = f64::max(long * 5.0 / 4.0, short * 5.0 / 3.0);
        self.film_mm() / FILM_DIAGONAL_MM * diagonal
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lens_distinguishes_the_main_camera_from_the_others() {
        let found =
            |model, lens_mm| KnownCamera::find("Apple", model, lens_mm).map(KnownCamera::film_mm);
        assert_eq!(found("iPhone 12", 4.2), Some(26.0));
        assert_eq!(found("iPhone 15 Pro", 6.764_999_8), Some(24.0));
        // The ultra-wide camera, and a model that is not in the table.
        assert_eq!(found("iPhone 12", 1.55), None);
        assert_eq!(found("iPhone 12 Ultra", 4.2), None);
        let galaxy = KnownCamera::find("samsung", "SM-S911B", 5.4).unwrap();
        // tan(85° / 2) = 0.9163.
        assert!((galaxy.film_mm() - 43.2666 / 2.0 / 0.9163).abs() < 0.01);
    }

    #[test]
    fn a_wider_picture_keeps_the_sensors_long_side() {
        let phone = KnownCamera::find("Apple", "iPhone 12", 4.2).unwrap();
        let whole = phone.focal_px((4000, 3000));
        assert!((whole - 26.0 / 43.2666 * 5000.0).abs() < 0.1, "{whole}");
        assert_eq!(phone.focal_px((4000, 2250)), whole);
        assert_eq!(phone.focal_px((3000, 4000)), whole);
        assert_eq!(phone.focal_px((3000, 3000)), whole);
    }
}
