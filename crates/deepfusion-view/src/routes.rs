//! The server's routes.
//!
//! | Path | Answer |
//! |---|---|
//! | `/`, `/app/FILE` | the page and its files |
//! | `/api/session` | the folders, colour maps, the depth scale |
//! | `/api/runs/R/index?known=V` | the frames of folder R and the numbers of the time line |
//! | `/api/runs/R/frame/NAME` | a frame: camera, targets, problems |
//! | `/api/runs/R/depth/NAME` | [`DepthFile::into_bytes`] |
//! | `/api/runs/R/sigma/NAME` | the same of its standard deviation |
//! | `/api/runs/R/image/NAME` | the picture's own bytes |
//! | `/api/runs/R/tracks?from=I&count=N` | centres of the targets of consecutive frames |
//! | `/api/runs/R/training`, `/api/runs/R/panel/FILE` | a training run's curve and panels |

use std::path::Path;

use deepfusion_hint::Hint;
use deepfusion_render::{ColourMap, DepthScale};
use serde::Serialize;

use crate::folder::{FrameFile, SmallFiles, Track, details_of, picture_of, targets_of};
use crate::http::{Request, Response};
use crate::{DepthFile, Error, Folder, FolderKind, assets, training};

/// Most frames in one answer of tracks.
const MOST_TRACK_FRAMES: u64 = 256;

/// The folders that are served, and for whom.
#[derive(Debug)]
pub(crate) struct Routes {
    folders: Vec<Folder>,
    /// Whether only this machine is served.
    local: bool,
}

impl Routes {
    pub(crate) fn new(folders: Vec<Folder>, local: bool) -> Self {
        Self { folders, local }
    }

    /// The answer to a request.
    pub(crate) fn answer(&self, request: &Request) -> Response {
        // Against DNS rebinding: another site could resolve its own name to this machine's address and then read what is served here.
        if self.local && !request.host.as_deref().is_none_or(is_this_machine) {
            return Response::problem(
                403,
                "this server answers only to 127.0.0.1 and localhost",
                None,
            );
        }
        let parts: Vec<&str> = request.path.iter().map(String::as_str).collect();
        match parts.as_slice() {
            [] => Response::ok("text/html; charset=utf-8", assets::PAGE.as_bytes()),
            ["app", name] => match assets::find(name) {
                Some((content_type, content)) => Response::ok(content_type, content),
                None => nothing(),
            },
            ["api", "session"] => Response::json(&self.session()),
            ["api", "runs", run, rest @ ..] => {
                match run.parse().ok().and_then(|i: usize| self.folders.get(i)) {
                    Some(folder) => of_folder(folder, rest, request),
                    None => nothing(),
                }
            }
            _ => nothing(),
        }
    }

    fn session(&self) -> Session {
        let runs = self.folders.iter().map(|folder| Run {
            kind: match folder.kind() {
                FolderKind::Predictions => "predictions",
                FolderKind::Training => "training",
            },
            name: folder.name(),
            path: folder.path().display().to_string(),
        });
        let scale = DepthScale::default();
        Session {
            colours: Colours {
                diverging: table(ColourMap::Diverging),
                magma: table(ColourMap::Magma),
                turbo: table(ColourMap::Turbo),
            },
            depth_scale: ScaleColours {
                colours: depth_colours(&scale),
                far_m: scale.far_m,
                near_m: scale.near_m,
            },
            runs: runs.collect(),
            version: env!("CARGO_PKG_VERSION"),
        }
    }
}

/// The first answer to the page: colours, runs and version.
#[derive(Debug, Serialize)]
struct Session {
    colours: Colours,
    depth_scale: ScaleColours,
    runs: Vec<Run>,
    version: &'static str,
}

/// The colour maps, each as a [`table`].
#[derive(Debug, Serialize)]
struct Colours {
    diverging: Vec<[u8; 3]>,
    magma: Vec<[u8; 3]>,
    turbo: Vec<[u8; 3]>,
}

/// Colours from near to far on a logarithmic scale, as in the pictures that `predict` writes.
#[derive(Debug, Serialize)]
struct ScaleColours {
    colours: Vec<[u8; 3]>,
    far_m: f32,
    near_m: f32,
}

/// A folder that is shown.
#[derive(Debug, Serialize)]
struct Run {
    kind: &'static str,
    name: String,
    path: String,
}

/// The targets of consecutive frames.
#[derive(Debug, Serialize)]
struct Tracks {
    /// Index of the first frame.
    from: usize,
    /// One per frame; `None` for a frame without a file of targets.
    tracks: Vec<Option<Track>>,
}

/// A map's colours at 256 values evenly spaced from 0 to 1.
fn table(map: ColourMap) -> Vec<[u8; 3]> {
    (0..=255u8)
        .map(|i| map.colour(f32::from(i) / 255.0).0)
        .collect()
}

/// The depth scale's colours at 256 depths from near to far, evenly spaced on its logarithmic scale.
fn depth_colours(scale: &DepthScale) -> Vec<[u8; 3]> {
    let ratio = scale.far_m / scale.near_m;
    (0..=255u8)
        .map(|i| {
            scale
                .colour(scale.near_m * ratio.powf(f32::from(i) / 255.0))
                .0
        })
        .collect()
}

fn of_folder(folder: &Folder, rest: &[&str], request: &Request) -> Response {
    let (path, training) = (folder.path(), folder.kind() == FolderKind::Training);
    match rest {
        ["index"] if !training => Response::json(&folder.index(request.number("known"))),
        ["tracks"] if !training => {
            let from = request.number("from").unwrap_or(0) as usize;
            let count = request.number("count").unwrap_or(1).min(MOST_TRACK_FRAMES) as usize;
            let entries = folder.entries(from, count);
            let tracks = entries.iter().map(|e| targets_of(path, e)).collect();
            Response::json(&Tracks { from, tracks })
        }
        [what @ ("frame" | "depth" | "sigma" | "image"), name] if !training => {
            match folder.entry(name) {
                None => Response::problem(404, &format!("there is no frame {name}"), None),
                Some(entry) => match *what {
                    "frame" => Response::json(&details_of(path, &entry)),
                    "depth" => map(
                        path,
                        SmallFiles::read(path, &entry).depth(&entry),
                        "no depth was saved for this frame",
                    ),
                    "sigma" => map(
                        path,
                        SmallFiles::read(path, &entry).sigma(&entry),
                        "no sigma was saved for this frame",
                    ),
                    _ => match picture_of(path, &entry) {
                        Ok(picture) => file(&picture.path, picture.content_type),
                        Err(none) => Response::problem(422, &none.to_string(), None),
                    },
                },
            }
        }
        ["training"] if training => sent(training::read(path).map(|run| Response::json(&run))),
        ["panel", name] if training => match training::panel(path, name) {
            Some(panel) => file(&panel, "image/png"),
            None => nothing(),
        },
        _ => nothing(),
    }
}

/// The response with the numbers of depth or of its standard deviation.
fn map(folder: &Path, file: Option<&FrameFile>, missing: &str) -> Response {
    let Some(FrameFile { file, .. }) = file else {
        return Response::problem(404, missing, None);
    };
    let read = DepthFile::read(&folder.join(file));
    sent(read.map(|map| Response::ok("application/octet-stream", map.into_bytes())))
}

fn file(path: &Path, content_type: &'static str) -> Response {
    let read = std::fs::read(path).map_err(|e| Error::file(path, e));
    sent(read.map(|bytes| Response::ok(content_type, bytes)))
}

fn sent(outcome: Result<Response, Error>) -> Response {
    outcome.unwrap_or_else(|e| Response::problem(422, &e.to_string(), e.hint().as_deref()))
}

fn nothing() -> Response {
    Response::problem(404, "nothing is served at this address", None)
}

fn is_this_machine(host: &str) -> bool {
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    host.eq_ignore_ascii_case("localhost")
        || bare
            .parse()
            .is_ok_and(|ip: std::net::IpAddr| ip.is_loopback())
}
