//! The server's answers to a plain client.

use std::io::{Read, Write};
use std::net::TcpStream;

use crate::support::{
    self, CAMERA, Running, SIZE, any_port, results, steps, write_frame, write_sidecar,
};
use deepfusion_hint::Hint;
use deepfusion_view::{Error, Folder, FolderKind, Server, Settings};
use serde_json::{Value, json};

fn problems(frame: &Value) -> String {
    let list = frame["problems"].as_array().unwrap().iter();
    list.map(|p| p.as_str().unwrap())
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn depth_is_sent_as_it_is_in_the_file() {
    let folder = results(3);
    let metres: Vec<f32> = (0..12)
        .map(|i| [0.1, f32::NAN, 0.0, 80.25][i % 4] * (1.0 + i as f32))
        .collect();
    let array = ndarray::Array2::from_shape_vec((3, 4), metres.clone()).unwrap();
    ndarray_npy::write_npy(folder.path().join("array_depth.npy"), &array).unwrap();
    let server = Running::start(folder.path(), None);
    for i in 0..3 {
        let (status, body) = server.get(&format!("/api/runs/0/depth/{i:06}"));
        assert_eq!(status, 200);
        assert_eq!(&body[..4], b"DFD1");
        assert_eq!(body[4..16], [96u32, 48, 0].map(u32::to_le_bytes).concat());
        let mut sent = body[16..]
            .chunks_exact(2)
            .map(|b| u16::from_le_bytes([b[0], b[1]]));
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                assert_eq!(
                    sent.next(),
                    Some(steps(i, x, y)),
                    "frame {i}, pixel {x}, {y}"
                );
            }
        }
        assert_eq!(sent.next(), None);
    }
    let (status, body) = server.get("/api/runs/0/depth/array");
    assert_eq!(status, 200);
    assert_eq!(body[4..16], [4u32, 3, 1].map(u32::to_le_bytes).concat());
    let expected: Vec<u8> = metres.iter().flat_map(|m| m.to_le_bytes()).collect();
    assert_eq!(body[16..], expected);
}

/// An output that the sidecar does not name is older, and perhaps of another camera.
#[test]
fn only_outputs_that_the_sidecar_names_are_shown() {
    let folder = results(2);
    let earlier = ndarray::Array2::<f32>::ones((48, 96));
    for i in 0..2 {
        for what in ["depth", "sigma"] {
            let file = format!("{i:06}_{what}.npy");
            ndarray_npy::write_npy(folder.path().join(file), &earlier).unwrap();
        }
    }
    write_sidecar(
        folder.path(),
        "000000",
        &json!({"files": ["000000_depth.png"]}),
    );
    let server = Running::start(folder.path(), None);
    let index = server.json("/api/runs/0/index");
    assert_eq!(index["has_depth"], json!([1, 1]));
    assert_eq!(index["has_sigma"], json!([0, 1]));
    let depth_of = |frame: &str| {
        let details = server.json(&format!("/api/runs/0/frame/{frame}"));
        let (status, body) = server.get(&format!("/api/runs/0/depth/{frame}"));
        assert_eq!(status, 200);
        // Code 0 means steps of a PNG, 1 metres.
        (details["depth"].clone(), body[12])
    };
    assert_eq!(depth_of("000000"), (json!("000000_depth.png"), 0));
    assert_eq!(server.get("/api/runs/0/sigma/000000").0, 404);
    // Another program's sidecar names no outputs: all are shown.
    assert_eq!(depth_of("000001"), (json!("000001_depth.npy"), 1));
    assert_eq!(server.get("/api/runs/0/sigma/000001").0, 200);
}

#[test]
fn a_frame_has_its_camera_targets_and_picture() {
    let folder = results(2);
    let server = Running::start(folder.path(), None);
    let frame = server.json("/api/runs/0/frame/000001");
    assert_eq!(problems(&frame), "");
    let [fx, fy, cx, cy] = CAMERA;
    assert_eq!(
        frame["intrinsics"],
        json!({"fx": fx, "fy": fy, "cx": cx, "cy": cy, "width": 96, "height": 48})
    );
    assert_eq!(frame["targets"]["targets"][0], support::target(1));
    assert_eq!(frame["picture"]["size"], json!([96, 48]));
    let (status, picture) = server.get("/api/runs/0/image/000001");
    assert_eq!(
        (status, picture),
        (
            200,
            std::fs::read(folder.path().join("000001_image.png")).unwrap()
        )
    );
    let tracks = server.json("/api/runs/0/tracks?from=0&count=9");
    assert_eq!(
        tracks["tracks"][1]["targets"],
        json!([[7, [1.0, 0.5, 13.5]]])
    );
    let index = server.json("/api/runs/0/index");
    assert_eq!(index["names"], json!(["000000", "000001"]));
    assert_eq!(index["series"]["targets"], json!([1, 1]));
    assert_eq!(index["series"]["time_s"], json!([0.0, 0.1]));
    assert_eq!(index["series"]["near_m"], json!([5.9, 5.9]));
    assert_eq!(index["series"]["problem"], json!([null, null]));
}

fn keys(object: &Value) -> String {
    let object = object.as_object().unwrap();
    object
        .keys()
        .map(String::as_str)
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn unknown_fields_of_a_frame_are_left_out_or_null() {
    let folder = results(2);
    for file in ["000001.json", "000001_image.png", "000001_targets.json"] {
        std::fs::remove_file(folder.path().join(file)).unwrap();
    }
    let server = Running::start(folder.path(), None);
    let whole = server.json("/api/runs/0/frame/000000");
    assert_eq!(
        keys(&whole),
        "depth depth_m focal_factor image intrinsics intrinsics_from name picture problems revision scale_trusted targets unit window"
    );
    assert_eq!(keys(&whole["picture"]), "path size");
    let poor = server.json("/api/runs/0/frame/000001");
    assert_eq!(keys(&poor), "depth name problems revision targets");
    assert_eq!(poor["targets"], Value::Null);
    let index = server.json("/api/runs/0/index");
    assert_eq!(
        keys(&index),
        "failure has_depth has_sigma names pending revisions series version"
    );
    assert_eq!(
        keys(&index["series"]),
        "far_m latency_ms near_m nearest_m problem scale_ratio scale_state speed_mps targets time_s time_to_collision_s"
    );
    assert_eq!(index["series"]["targets"], json!([1, null]));
    let version = index["version"].as_u64().unwrap();
    let known = server.json(&format!("/api/runs/0/index?known={version}"));
    assert_eq!(known, json!({"unchanged": true, "version": version}));
}

#[test]
fn the_scale_monitor_is_shown_for_predictions_too() {
    let folder = results(2);
    let answer = json!({"ratio": 1.08, "state": "drift", "correction": 1.02});
    write_sidecar(folder.path(), "000001", &json!({"scale_monitor": answer}));
    let server = Running::start(folder.path(), None);
    let index = server.json("/api/runs/0/index");
    assert_eq!(index["series"]["scale_ratio"], json!([null, 1.08]));
    assert_eq!(index["series"]["scale_state"], json!([null, "drift"]));
    let frame = server.json("/api/runs/0/frame/000001");
    assert_eq!(frame["scale_monitor"], answer);
}

/// Whichever version wrote the sidecar.
#[test]
fn the_verdict_about_the_scale_is_passed_on() {
    let folder = results(2);
    let scale = json!({"bias": 0.01, "ci95": [-0.02, 0.04], "verdict": "trusted"});
    let now = json!({"camera_known": true, "scale": scale, "scale_trusted": null});
    write_sidecar(folder.path(), "000001", &now);
    let server = Running::start(folder.path(), None);
    let older = server.json("/api/runs/0/frame/000000");
    assert_eq!(older["scale_trusted"], true);
    assert_eq!(older["problems"], json!([]));
    let frame = server.json("/api/runs/0/frame/000001");
    assert_eq!(
        (&frame["camera_known"], &frame["scale"]),
        (&json!(true), &scale)
    );
}

#[test]
fn broken_files_are_reported_and_the_rest_is_shown() {
    let folder = results(7);
    let at = |file: &str| folder.path().join(file);
    let cut = |file: &str| {
        let whole = std::fs::read(at(file)).unwrap();
        std::fs::write(at(file), &whole[..whole.len() / 2]).unwrap();
    };
    cut("000000.json");
    cut("000001_depth.png");
    cut("000002_targets.json");
    std::fs::remove_file(at("000003_image.png")).unwrap();
    write_sidecar(folder.path(), "000004", &json!({"size": [640, 192]}));
    write_sidecar(
        folder.path(),
        "000005",
        &json!({"intrinsics": [0.0, 58.0, 47.0, 22.5]}),
    );
    std::fs::write(at("notes.json"), r#"{"written by": "somebody else"}"#).unwrap();
    std::fs::write(at("coming.json"), r#"{"image": "#).unwrap();
    let server = Running::start(folder.path(), None);
    let problems_of = |name: &str| problems(&server.json(&format!("/api/runs/0/frame/{name}")));
    for (name, expected) in [
        ("000000", "000000.json: incomplete or truncated"),
        ("000001", ""),
        ("000002", "000002_targets.json: incomplete or truncated"),
        ("000003", "gone/street.mp4: the picture no longer exists"),
        ("000004", "depth is 96x48, the sidecar says 640x192"),
        ("000004", "the picture is 96x48, the sidecar says 640x192"),
        ("000005", "the sidecar's camera is invalid: fx is 0"),
        ("000006", ""),
        ("coming", "incomplete or truncated"),
    ] {
        let text = problems_of(name);
        assert!(
            text.contains(expected) && text.is_empty() == expected.is_empty(),
            "{name}: {text}"
        );
    }
    let (status, body) = server.get("/api/runs/0/depth/000001");
    let answer: Value = serde_json::from_slice(&body).unwrap();
    assert_eq!(status, 422);
    assert!(
        answer["error"]
            .as_str()
            .unwrap()
            .contains("000001_depth.png: the image is truncated"),
        "{answer}"
    );
    assert_eq!(server.get("/api/runs/0/image/000003").0, 422);
    assert_eq!(
        server.get("/api/runs/0/depth/000000").0,
        200,
        "only the sidecar is broken"
    );
    let index = server.json("/api/runs/0/index");
    assert_eq!(index["names"].as_array().unwrap().len(), 8, "{index}");
    assert!(
        index["series"]["problem"][0]
            .as_str()
            .unwrap()
            .contains("incomplete")
    );
}

#[test]
fn nothing_outside_the_folders_is_served() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("results");
    std::fs::create_dir(&folder).unwrap();
    (0..2).for_each(|i| write_frame(&folder, i));
    std::fs::write(
        outer.path().join("secret.json"),
        r#"{"image": "x", "size": [1, 1]}"#,
    )
    .unwrap();
    std::fs::write(outer.path().join("secret_depth.png"), "hidden words").unwrap();
    std::fs::write(outer.path().join("secret.txt"), "hidden words").unwrap();
    // A folder from elsewhere may name any file as its picture; files that are not pictures are not sent.
    std::fs::remove_file(folder.join("000001_image.png")).unwrap();
    write_sidecar(
        &folder,
        "000001",
        &json!({"image": outer.path().join("secret.txt")}),
    );
    let server = Running::start(&folder, None);
    for path in [
        "/api/runs/0/depth/../secret",
        "/api/runs/0/depth/..%2Fsecret",
        "/api/runs/0/depth/%2e%2e%2fsecret",
        "/api/runs/0/frame/..%2Fsecret",
        "/api/runs/0/frame/%00",
        "/api/runs/0/panel/..%2F..%2Fsecret.txt",
        "/api/runs/1/index",
        "/api/runs/-1/index",
        "/api/runs/0/training",
        "/app/..%2F..%2Fsrc%2Flib.rs",
        "/app/../Cargo.toml",
        "/../../../../etc/passwd",
        "//etc/passwd",
        "/secret.txt",
        "/api/runs/0/image/000001",
    ] {
        let (status, body) = server.get(path);
        let expected = if path.ends_with("000001") { 422 } else { 404 };
        assert_eq!(status, expected, "{path}");
        assert!(
            !String::from_utf8_lossy(&body).contains("hidden words"),
            "{path}"
        );
    }
}

#[test]
fn only_requests_from_this_machine_are_answered() {
    let folder = results(1);
    let server = Running::start(folder.path(), None);
    let status = |head: &str| {
        server
            .raw(format!("{head}\r\nConnection: close\r\n\r\n").as_bytes())
            .0
    };
    assert_eq!(status("GET / HTTP/1.1\r\nHost: localhost:1"), 200);
    assert_eq!(status("GET / HTTP/1.1\r\nHost: [::1]"), 200);
    assert_eq!(
        status("GET /api/session HTTP/1.1\r\nHost: elsewhere.example"),
        403
    );
    assert_eq!(status("POST /api/session HTTP/1.1\r\nHost: localhost"), 405);
    assert_eq!(status("DELETE / HTTP/1.1\r\nHost: localhost"), 405);
    assert_eq!(status("nonsense"), 400);
    assert_eq!(
        status(&format!(
            "GET /{} HTTP/1.1\r\nHost: localhost",
            "a".repeat(40_000)
        )),
        431
    );
    let (status, body) =
        server.raw(b"HEAD /api/runs/0/depth/000000 HTTP/1.1\r\nConnection: close\r\n\r\n");
    assert_eq!((status, body.len()), (200, 0));
}

#[test]
fn a_connection_stays_open_for_the_next_request() {
    let folder = results(2);
    let server = Running::start(folder.path(), None);
    let mut stream = TcpStream::connect(server.address).unwrap();
    // Two at once, then one more.
    stream.write_all(b"GET /api/runs/0/depth/000000 HTTP/1.1\r\n\r\nGET /api/runs/0/depth/000001 HTTP/1.1\r\n\r\n").unwrap();
    let mut first = vec![0; 3000];
    stream.read_exact(&mut first).unwrap();
    stream
        .write_all(b"GET /api/session HTTP/1.1\r\nConnection: close\r\n\r\n")
        .unwrap();
    let mut rest = Vec::new();
    stream.read_to_end(&mut rest).unwrap();
    let all = [first, rest].concat();
    let answers = all.windows(15).filter(|w| w == b"HTTP/1.1 200 OK").count();
    assert_eq!(answers, 3);
}

#[test]
fn a_folder_that_grows_is_followed() {
    let folder = results(2);
    let server = Running::start(folder.path(), None);
    let index = server.json("/api/runs/0/index");
    let version = index["version"].as_u64().unwrap();
    let known = format!("/api/runs/0/index?known={version}");
    assert_eq!(server.json(&known)["unchanged"], json!(true));
    write_frame(folder.path(), 2);
    let grown = server.json(&known);
    assert_eq!(grown["names"], json!(["000000", "000001", "000002"]));
    // Replacing a file changes its frame's revision.
    let revision = grown["revisions"][0].clone();
    let spare = folder.path().join(".spare");
    std::fs::copy(folder.path().join("000002_depth.png"), &spare).unwrap();
    std::fs::rename(&spare, folder.path().join("000000_depth.png")).unwrap();
    assert_ne!(server.json("/api/runs/0/index")["revisions"][0], revision);
    std::fs::remove_file(folder.path().join("000001.json")).unwrap();
    std::fs::remove_file(folder.path().join("000001_depth.png")).unwrap();
    std::fs::remove_file(folder.path().join("000001_targets.json")).unwrap();
    assert_eq!(
        server.json("/api/runs/0/index")["names"],
        json!(["000000", "000002"])
    );
}

#[test]
fn a_removed_folder_is_named() {
    let folder = results(1);
    let path = folder.path().to_owned();
    let server = Running::start(&path, None);
    assert_eq!(server.json("/api/runs/0/index")["failure"], Value::Null);
    folder.close().unwrap();
    let failure = format!("{}: no such file or folder", path.display());
    assert_eq!(server.json("/api/runs/0/index")["failure"], failure);
}

#[test]
fn folders_that_cannot_be_shown_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let of = |path: &std::path::Path| Folder::open(path).unwrap_err();
    let nowhere = of(&folder.path().join("nowhere"));
    assert!(matches!(nowhere, Error::NoSuchFolder { .. }) && nowhere.hint().is_some());
    let nowhere = nowhere.to_string();
    assert!(
        nowhere.ends_with("nowhere: no such file or folder"),
        "{nowhere}"
    );
    let empty = of(folder.path());
    assert!(matches!(empty, Error::NothingToShow { .. }));
    assert!(
        empty
            .hint()
            .unwrap()
            .contains("predict some images, find targets or train a network first"),
        "{empty}"
    );
    let file = folder.path().join("a.txt");
    std::fs::write(&file, "x").unwrap();
    assert!(matches!(of(&file), Error::NotAFolder { .. }));
}

#[test]
fn a_port_in_use_is_named() {
    let folder = results(1);
    let server = Running::start(folder.path(), None);
    let settings = Settings {
        port: server.address.port(),
        ..any_port()
    };
    let error = Server::bind(settings, Folder::open(folder.path()).unwrap(), None).unwrap_err();
    assert!(matches!(error, Error::PortInUse { .. }), "{error}");
    assert!(
        error.to_string().contains(&server.address.to_string()),
        "{error}"
    );
    assert!(error.hint().unwrap().contains("another port"), "{error}");
}

#[test]
fn a_run_shows_its_curve_and_panels() {
    let run = tempfile::tempdir().unwrap();
    std::fs::create_dir(run.path().join("panels")).unwrap();
    image::RgbImage::new(4, 4)
        .save(run.path().join("panels/000034.png"))
        .unwrap();
    // The last line is still being written.
    let log = "step,split,total,speed,flow\n1,train,0.5,1,0\n2,train,0.4,NaN,0\n2,validation,0.45,,\n3,train,0.3";
    std::fs::write(run.path().join("log.csv"), log).unwrap();
    let server = Running::start(run.path(), None);
    let answer = server.json("/api/runs/0/training");
    assert_eq!(
        answer["train"],
        json!({"step": [1.0, 2.0], "total": [0.5, 0.4], "speed": [1.0, null], "flow": [0.0, 0.0]})
    );
    // A column that is zero throughout is not drawn.
    assert_eq!(answer["columns"], json!(["step", "total", "speed"]));
    assert_eq!(answer["validation"]["total"], json!([0.45]));
    assert_eq!(answer["panels"], json!(["000034.png"]));
    assert_eq!(server.get("/api/runs/0/panel/000034.png").0, 200);
    assert_eq!(server.get("/api/runs/0/panel/000035.png").0, 404);
    assert_eq!(
        server.json("/api/session")["runs"][0]["kind"],
        json!("training")
    );
    let frames = results(1);
    let open = |p: &std::path::Path| Folder::open(p).unwrap();
    let error = Server::bind(any_port(), open(run.path()), Some(open(frames.path()))).unwrap_err();
    assert!(
        matches!(
            error,
            Error::OtherKind {
                found: FolderKind::Predictions,
                expected: FolderKind::Training,
                ..
            }
        ) && error.hint().is_some(),
        "{error}"
    );
    let expected = "contains predictions, which cannot be shown beside a training run";
    assert!(error.to_string().ends_with(expected), "{error}");
}

/// Resident memory of this process in MiB; `None` if the system does not report it.
fn resident_mib() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: f64 = text.split(' ').nth(1)?.parse().ok()?;
    Some(pages * 4096.0 / f64::from(1 << 20))
}

#[test]
fn memory_does_not_grow_with_the_bytes_sent() {
    let folder = tempfile::tempdir().unwrap();
    // A megabyte per frame.
    ndarray_npy::write_npy(
        folder.path().join("a_depth.npy"),
        &ndarray::Array2::<f32>::ones((512, 512)),
    )
    .unwrap();
    let server = Running::start(folder.path(), None);
    let ask = |count: usize| {
        (0..count)
            .for_each(|_| assert_eq!(server.get("/api/runs/0/depth/a").1.len(), (1 << 20) + 16))
    };
    ask(30);
    let before = resident_mib();
    ask(300);
    if let (Some(before), Some(after)) = (before, resident_mib()) {
        // Other tests run in the same process at the same time.
        assert!(
            after - before < 60.0,
            "{before} MiB before 300 frames of a MiB, {after} MiB after"
        );
    }
}
