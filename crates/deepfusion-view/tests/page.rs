//! The page in a real browser: it shows the content of the files. Without a Chromium, the tests print that and pass.

#![cfg(unix)]

use std::time::{Duration, Instant};

use crate::support::browser::Browser;
use crate::support::{CAMERA, Running, SIZE, results, steps, target, write_frame};
use deepfusion_geometry::Intrinsics;
use nalgebra::{Rotation3, Vector3};
use serde_json::{Value, json};

const FRAMES: usize = 12;

fn opened(server: &Running) -> Option<Browser> {
    let mut browser = Browser::start(1200, 800)?;
    browser.open(&server.url);
    browser.wait_for("window.deepfusion?.ready || window.deepfusion?.failure");
    assert_eq!(browser.value("deepfusion.failure ?? null"), Value::Null);
    Some(browser)
}

/// Moves the mouse onto a pixel of a pane, and returns the metres and the text that the page then shows.
fn reading_at(browser: &mut Browser, pane: &str, x: u32, y: u32) -> (f64, String) {
    let place = format!(
        "(() => {{ const pane = deepfusion.app.kinds[0].{pane}, at = pane.layout(), box = pane.canvas.getBoundingClientRect(); \
         return [box.left + at.left + ({x} + 0.5) / {} * at.width, box.top + at.top + ({y} + 0.5) / {} * at.height]; }})()",
        SIZE.0, SIZE.1
    );
    let reading =
        format!("(document.getElementById('tip').innerText + '\\n').includes('pixel {x}, {y}\\n')");
    // The panes take their shapes from the first pictures, so positions may change once.
    let begin = Instant::now();
    loop {
        let at = browser.value(&place);
        browser.mouse(at[0].as_f64().unwrap(), at[1].as_f64().unwrap());
        std::thread::sleep(Duration::from_millis(50));
        if browser.value(&reading) == json!(true) {
            break;
        }
        assert!(
            begin.elapsed() < Duration::from_secs(60),
            "{pane} {x}, {y}: {at}, {}",
            browser.value("document.getElementById('tip').innerText")
        );
    }
    let metres = browser.value("Number(document.querySelector('#tip b').dataset.metres)");
    let text = browser.value("document.querySelector('#tip b').innerText");
    (metres.as_f64().unwrap(), text.as_str().unwrap().to_owned())
}

#[test]
fn the_page_shows_the_content_of_the_files() {
    let folder = results(FRAMES);
    let server = Running::start(folder.path(), None);
    let Some(mut browser) = opened(&server) else {
        return;
    };
    assert_eq!(browser.complaints, Vec::<String>::new());

    // The cloud's points have the pictures' colour, which nothing else has.
    let seen = browser.value(
        "(() => { const view = deepfusion.app.kinds[0].cloud; view.draw(true); const { gl, canvas } = view; \
         const pixels = new Uint8Array(4 * canvas.width * canvas.height); \
         gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels); \
         let seen = 0; for (let i = 0; i < pixels.length; i += 4) if (pixels[i] > 200 && pixels[i + 1] < 30 && pixels[i + 2] > 190) seen++; \
         return seen; })()",
    );
    assert!(seen.as_u64().unwrap() > 2000, "{seen} pixels of the cloud");

    // Metres under the pointer are those of the file, to the last digit, on either picture.
    for (x, y) in [(10, 5), (0, 47), (95, 0), (48, 24), (71, 33)] {
        for pane in ["depth", "picture"] {
            let (metres, text) = reading_at(&mut browser, pane, x, y);
            let expected = f64::from(steps(0, x, y)) / 256.0;
            assert_eq!(metres, expected, "{pane} {x}, {y}");
            assert_eq!(text, format!("{expected:.2} m"));
        }
    }
    assert_eq!(
        reading_at(&mut browser, "depth", 2, 2),
        (0.0, "no depth".into())
    );

    boxes_are_in_the_right_place(&mut browser);

    // Playing and stepping.
    browser.key(" ");
    browser.wait_for("deepfusion.app.drawnFrame >= '000003'");
    browser.key(" ");
    browser.wait_for("!deepfusion.app.player.playing");
    let there = browser.value("deepfusion.app.frame").as_u64().unwrap();
    browser.key("ArrowLeft");
    browser.wait_for(&format!("deepfusion.app.drawnFrame === '{:06}'", there - 1));
    browser.key("End");
    browser.wait_for(&format!(
        "deepfusion.app.drawnFrame === '{:06}'",
        FRAMES - 1
    ));
    let (metres, _) = reading_at(&mut browser, "depth", 48, 24);
    assert_eq!(
        metres,
        f64::from(steps(FRAMES - 1, 48, 24)) / 256.0,
        "the last frame's own depth"
    );

    // Past positions of the target: half a metre nearer in each frame, while the camera drives 0.2 m.
    browser.wait_for("deepfusion.app.runs[0].history(11, 4, () => {}).length === 4");
    let track = browser
        .value("deepfusion.app.runs[0].history(11, 4, () => {}).map(f => f.targets[0][1][2])");
    let track: Vec<f64> = serde_json::from_value(track).unwrap();
    assert_eq!(track, [10.0, 9.5, 9.0, 8.5]);

    // The cache stays within its limits.
    let held = browser.value(
        "(async () => { const { runs: [run] } = deepfusion.app; for (const key of [...run.frames.entries.keys()]) run.frames.delete(key); \
         await deepfusion.app.seek(0); run.frames.most = 3 * run.at(0).bytes; \
         for (let i = 0; i < run.length; i++) await deepfusion.app.seek(i); \
         return [run.frames.bytes <= run.frames.most, run.frames.entries.size, deepfusion.app.shown(0).name, deepfusion.app.shown(0).bitmap.width]; })()",
    );
    assert_eq!(held[0], json!(true), "{held}");
    assert!((1..=3).contains(&held[1].as_u64().unwrap()), "{held}");
    assert_eq!(
        (&held[2], &held[3]),
        (&json!("000011"), &json!(96)),
        "the frame on screen is kept"
    );

    browser.key("?");
    browser.wait_for("document.getElementById('help').open");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Compares the eight corners of a box in the picture with nalgebra's rotation and the crate's camera, and checks that its lines are painted there.
fn boxes_are_in_the_right_place(browser: &mut Browser) {
    let [fx, fy, cx, cy] = CAMERA;
    let camera = Intrinsics {
        fx,
        fy,
        cx,
        cy,
        width: SIZE.0,
        height: SIZE.1,
    };
    let target = target(0);
    let numbers = |key: &str| {
        Vector3::from_iterator(
            target[key]
                .as_array()
                .unwrap()
                .iter()
                .map(|v| v.as_f64().unwrap()),
        )
    };
    let (centre, size) = (numbers("center_m"), numbers("size_m"));
    let cam_from_box =
        Rotation3::from_axis_angle(&Vector3::y_axis(), target["yaw_rad"].as_f64().unwrap());
    // In the box's axes: length x, height y, width z.
    let mut expected = Vec::new();
    for i in 0..8 {
        let side = |bit: usize| if i >> bit & 1 == 0 { -0.5 } else { 0.5 };
        let corner = Vector3::new(side(0) * size.x, side(1) * size.z, side(2) * size.y);
        expected.push(camera.project(&(centre + cam_from_box * corner)).unwrap());
    }
    let pixels = browser.value(
        "(() => { const { app, geometry } = deepfusion, frame = app.shown(0); \
         return geometry.boxCorners(frame.targets[0]).map(c => geometry.project(frame.camera, c)); })()",
    );
    let pixels: Vec<[f64; 2]> = serde_json::from_value(pixels).unwrap();
    assert_eq!(pixels.len(), 8);
    for corner in &expected {
        let off = pixels
            .iter()
            .map(|p| (p[0] - corner.x).hypot(p[1] - corner.y))
            .fold(f64::INFINITY, f64::min);
        assert!(
            off < 1e-9,
            "{corner} is {off} pixels from the nearest of {pixels:?}"
        );
    }
    // The middle of a vertical edge has the colour of dynamic targets.
    let colour = browser.value(&format!(
        "(() => {{ const {{ app }} = deepfusion, pane = app.kinds[0].picture, at = pane.layout(), {{ canvas }} = pane; \
         app.point(null); pane.draw(); \
         const [a, b] = [[{}, {}], [{}, {}]], x = ((a[0] + b[0]) / 2 + 0.5) / {} * at.width + at.left, y = ((a[1] + b[1]) / 2 + 0.5) / {} * at.height + at.top; \
         const near = canvas.getContext('2d').getImageData(x * canvas.ratio - 2, y * canvas.ratio - 1, 5, 3).data; \
         const style = getComputedStyle(document.documentElement).getPropertyValue('--moving').trim(); \
         const wanted = style.match(/[0-9a-f]{{2}}/gi).map(h => parseInt(h, 16)); \
         let best = 1e9; for (let i = 0; i < near.length; i += 4) best = Math.min(best, Math.max(...wanted.map((w, c) => Math.abs(near[i + c] - w)))); \
         return best; }})()",
        pixels[0][0], pixels[0][1], pixels[4][0], pixels[4][1], SIZE.0, SIZE.1
    ));
    assert!(
        colour.as_f64().unwrap() < 40.0,
        "the edge's colour is off by {colour}"
    );
}

#[test]
fn a_broken_frame_is_reported_and_new_ones_appear() {
    let folder = results(3);
    let depth = folder.path().join("000001_depth.png");
    let whole = std::fs::read(&depth).unwrap();
    std::fs::write(&depth, &whole[..whole.len() / 2]).unwrap();
    std::fs::write(folder.path().join("000002.json"), "{\"image\": ").unwrap();
    let server = Running::start(folder.path(), None);
    let Some(mut browser) = opened(&server) else {
        return;
    };
    let problem = |pane: &str| format!("deepfusion.app.kinds[0].{pane}.problem");
    browser.key("ArrowRight");
    browser.wait_for(&format!(
        "{}.innerText.includes('truncated')",
        problem("depth")
    ));
    browser.key("ArrowRight");
    browser.wait_for(&format!(
        "{}.innerText.includes('incomplete')",
        problem("picture")
    ));
    browser.key("Home");
    browser.wait_for(&format!(
        "{}.hidden && deepfusion.app.drawnFrame === '000000'",
        problem("depth")
    ));
    // Repaired, and one more frame.
    std::fs::write(&depth, &whole).unwrap();
    write_frame(folder.path(), 3);
    browser.wait_for("deepfusion.app.runs[0].length === 4");
    browser.key("ArrowRight");
    browser.wait_for(&format!(
        "{}.hidden && deepfusion.app.drawnFrame === '000001'",
        problem("depth")
    ));
    let (metres, _) = reading_at(&mut browser, "depth", 48, 24);
    assert_eq!(metres, f64::from(steps(1, 48, 24)) / 256.0);
}

#[test]
fn two_runs_are_shown_side_by_side() {
    let (first, second) = (results(4), tempfile::tempdir().unwrap());
    // The second lacks frame 0, and its depth is a metre larger.
    for i in 1..4 {
        write_frame(second.path(), i);
        let map =
            deepfusion_images::read_depth_png(&second.path().join(format!("{i:06}_depth.png")))
                .unwrap();
        let farther = deepfusion_geometry::DepthMap {
            data: map
                .data
                .iter()
                .map(|d| if *d > 0.0 { d + 1.0 } else { 0.0 })
                .collect(),
            ..map
        };
        deepfusion_images::write_depth_png(
            &farther,
            &second.path().join(format!("{i:06}_depth.png")),
        )
        .unwrap();
    }
    let server = Running::start(first.path(), Some(second.path()));
    let Some(mut browser) = opened(&server) else {
        return;
    };
    browser.wait_for(
        "deepfusion.app.kinds[1].picture.problem.innerText.includes('no frame of this name')",
    );
    browser.key("ArrowRight");
    browser.wait_for(
        "deepfusion.app.shown(0)?.name === '000001' && deepfusion.app.shown(1)?.name === '000001'",
    );
    let (metres, _) = reading_at(&mut browser, "depth", 30, 30);
    let expected = f64::from(steps(1, 30, 30)) / 256.0;
    assert_eq!(metres, expected);
    let versus = browser.value("document.querySelector('#tip .versus').innerText");
    let change = 100.0 / expected;
    assert_eq!(
        versus,
        json!(format!("B: {:.2} m (+{change:.1} %)", expected + 1.0))
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Writes sigma of frame `i`: a fiftieth of the depth on the left, nine tenths of it on the right.
fn write_sigma(folder: &std::path::Path, i: usize, (width, height): (u32, u32)) {
    let at = |y: u32, x: u32| {
        let share = if x < width / 2 { 0.02 } else { 0.9 };
        f32::from(steps(i, x, y)) / 256.0 * share
    };
    let map = ndarray::Array2::from_shape_fn((height as usize, width as usize), |(y, x)| {
        at(y as u32, x as u32)
    });
    ndarray_npy::write_npy(folder.join(format!("{i:06}_sigma.npy")), &map).unwrap();
}

#[test]
fn uncertain_pixels_fade() {
    let folder = results(3);
    write_sigma(folder.path(), 0, SIZE);
    write_sigma(folder.path(), 1, (SIZE.0 / 2, SIZE.1));
    let server = Running::start(folder.path(), None);
    let Some(mut browser) = opened(&server) else {
        return;
    };
    // A painted pixel of depth on the left and on the right, and the number of the cloud's pixels.
    let seen = "(() => { const { depth, cloud } = deepfusion.app.kinds[0]; depth.draw(); \
         const pixel = (x, y) => [...depth.sheet.getContext('2d').getImageData(x, y, 1, 1).data]; \
         cloud.draw(true); const { gl, canvas } = cloud, pixels = new Uint8Array(4 * canvas.width * canvas.height); \
         gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels); \
         let points = 0; for (let i = 0; i < pixels.length; i += 4) if (pixels[i] > 200 && pixels[i + 1] < 30 && pixels[i + 2] > 190) points++; \
         return [pixel(20, 30), pixel(80, 30), points]; })()";
    let before = browser.value(seen);
    browser.key("u");
    browser.wait_for("deepfusion.app.options.fade && [...document.querySelectorAll('#tools button')].some(b => b.textContent === 'Fade' && b.ariaPressed === 'true')");
    let after = browser.value(seen);
    assert_eq!(after[0], before[0], "certain pixels do not fade");
    assert_ne!(after[1], before[1]);
    assert_eq!(
        after[1],
        json!([40, 40, 44, 255]),
        "uncertain pixels fade into the colour of no depth"
    );
    let [all, sure] = [&before[2], &after[2]].map(|points| points.as_u64().unwrap());
    assert!(
        10 * sure < 8 * all && 10 * sure > all,
        "{sure} pixels of {all} of the cloud"
    );
    let (metres, _) = reading_at(&mut browser, "depth", 20, 30);
    let reading = browser.value("document.querySelector('#tip [data-sigma]').innerText");
    assert_eq!(reading, json!(format!("± {:.2} m", 0.02 * metres)));

    // A sigma of another size is reported and fades nothing; a missing one fades nothing either.
    browser.key("ArrowRight");
    browser.wait_for(
        "deepfusion.app.kinds[0].picture.problem.innerText.includes('sigma is 48x48, depth 96x48')",
    );
    assert_eq!(browser.value("deepfusion.app.shown(0).sigma"), Value::Null);
    browser.key("ArrowRight");
    browser.wait_for("deepfusion.app.drawnFrame === '000002'");
    let unfaded = browser.value(seen);
    assert_ne!(unfaded[1], json!([40, 40, 44, 255]));
    assert_eq!(browser.complaints, Vec::<String>::new());
}
