//! The page's files, inside the binary.

/// Name, media type and content of each file.
const FILES: &[(&str, &str, &[u8])] = &[
    ("style.css", CSS, include_bytes!("../assets/style.css")),
    (
        "icon.svg",
        "image/svg+xml",
        include_bytes!("../assets/icon.svg"),
    ),
    ("api.js", JS, include_bytes!("../assets/js/api.js")),
    ("cache.js", JS, include_bytes!("../assets/js/cache.js")),
    (
        "cloud_view.js",
        JS,
        include_bytes!("../assets/js/cloud_view.js"),
    ),
    ("colour.js", JS, include_bytes!("../assets/js/colour.js")),
    ("depth.js", JS, include_bytes!("../assets/js/depth.js")),
    (
        "geometry.js",
        JS,
        include_bytes!("../assets/js/geometry.js"),
    ),
    (
        "gestures.js",
        JS,
        include_bytes!("../assets/js/gestures.js"),
    ),
    ("help.js", JS, include_bytes!("../assets/js/help.js")),
    ("icons.js", JS, include_bytes!("../assets/js/icons.js")),
    ("main.js", JS, include_bytes!("../assets/js/main.js")),
    ("orbit.js", JS, include_bytes!("../assets/js/orbit.js")),
    (
        "picture_pane.js",
        JS,
        include_bytes!("../assets/js/picture_pane.js"),
    ),
    ("player.js", JS, include_bytes!("../assets/js/player.js")),
    ("metres.js", JS, include_bytes!("../assets/js/metres.js")),
    ("run.js", JS, include_bytes!("../assets/js/run.js")),
    ("scene.js", JS, include_bytes!("../assets/js/scene.js")),
    ("shaders.js", JS, include_bytes!("../assets/js/shaders.js")),
    ("table.js", JS, include_bytes!("../assets/js/table.js")),
    (
        "timeline.js",
        JS,
        include_bytes!("../assets/js/timeline.js"),
    ),
    ("tip.js", JS, include_bytes!("../assets/js/tip.js")),
    (
        "training.js",
        JS,
        include_bytes!("../assets/js/training.js"),
    ),
];

const CSS: &str = "text/css; charset=utf-8";
const JS: &str = "text/javascript; charset=utf-8";

/// The page itself.
pub(crate) const PAGE: &str = include_str!("../assets/index.html");

/// Media type and content of a file.
pub(crate) fn find(name: &str) -> Option<(&'static str, &'static [u8])> {
    let (_, content_type, content) = FILES.iter().find(|(n, ..)| *n == name)?;
    Some((content_type, content))
}
