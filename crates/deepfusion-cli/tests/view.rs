//! `deepfusion view`, from its first line to Ctrl-C.
#![cfg(unix)]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};

use crate::support::in_folder;
use deepfusion_geometry::DepthMap;

#[test]
fn the_server_prints_its_address_answers_and_ends() {
    let folder = tempfile::tempdir().unwrap();
    let map = DepthMap {
        width: 4,
        height: 2,
        data: vec![1.5; 8],
    };
    deepfusion_data::write_depth_png(&map, &folder.path().join("a_depth.png")).unwrap();
    let mut process = Command::new(env!("CARGO_BIN_EXE_deepfusion"))
        .args(["view", ".", "--port", "0", "--no-open"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut url = String::new();
    BufReader::new(process.stdout.take().unwrap())
        .read_line(&mut url)
        .unwrap();
    let address = url.trim().strip_prefix("http://").unwrap();
    let address = address.strip_suffix('/').unwrap();
    let mut stream = TcpStream::connect(address).unwrap();
    stream
        .write_all(b"GET /api/runs/0/depth/a HTTP/1.1\r\nConnection: close\r\n\r\n")
        .unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let steps: Vec<u8> = [384u16; 8].iter().flat_map(|s| s.to_le_bytes()).collect();
    assert!(answer.ends_with(&steps));

    let port = address.rsplit_once(':').unwrap().1;
    let second = in_folder(folder.path(), &["view", ".", "--no-open", "--port", port]);
    assert_eq!((second.code, second.stdout.as_str()), (1, ""));
    assert_eq!(
        second.stderr,
        format!(
            "error: 127.0.0.1:{port}: the port is in use\n\
             hint: give another --port, or --port 0 for any free one\n"
        )
    );

    let pid = process.id().to_string();
    let killed = Command::new("kill").args(["-INT", &pid]).status().unwrap();
    assert!(killed.success());
    assert_eq!(process.wait().unwrap().code(), Some(0));
    let mut text = String::new();
    process
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut text)
        .unwrap();
    assert!(
        text.starts_with("1 frame in .; stop with Ctrl-C\n"),
        "{text}"
    );
}

#[cfg(not(feature = "rerun"))]
#[test]
fn a_build_without_rerun_says_how_to_get_it() {
    let folder = tempfile::tempdir().unwrap();
    let run = in_folder(folder.path(), &["view", ".", "--rerun", "a.rrd"]);
    assert_eq!((run.code, run.stdout.as_str()), (1, ""));
    assert_eq!(
        run.stderr,
        "error: this build writes no files for the rerun viewer\n\
         hint: build deepfusion with `cargo build --release --features rerun`, or leave out --rerun to look at the folder in a browser\n"
    );
    assert!(!folder.path().join("a.rrd").exists());
}

#[cfg(feature = "rerun")]
#[test]
fn a_rerun_file_is_written_once_and_bad_frames_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let map = DepthMap {
        width: 4,
        height: 2,
        data: vec![1.5; 8],
    };
    deepfusion_data::write_depth_png(&map, &folder.path().join("a_depth.png")).unwrap();
    std::fs::write(folder.path().join("b_depth.png"), "no picture").unwrap();
    let write = |more: &[&str]| {
        let args: Vec<&str> = [&["view", ".", "--rerun", "a.rrd"], more].concat();
        in_folder(folder.path(), &args)
    };
    let first = write(&[]);
    assert_eq!(
        (first.code, first.stdout.as_str()),
        (0, ""),
        "{}",
        first.stderr
    );
    assert!(first.stderr.contains("a.rrd: 2 frames"), "{}", first.stderr);
    let named = |line: &str| line.contains("WARN b: ") && line.contains("b_depth.png");
    assert!(first.stderr.lines().any(named), "{}", first.stderr);
    let bytes = std::fs::read(folder.path().join("a.rrd")).unwrap();
    assert!(bytes.starts_with(b"RRF2"));

    let second = write(&[]);
    assert_eq!(second.code, 1);
    assert_eq!(
        second.stderr,
        "error: a.rrd: already exists\n\
         hint: choose another name, or give --overwrite to replace a file\n"
    );
    assert_eq!(std::fs::read(folder.path().join("a.rrd")).unwrap(), bytes);
    assert_eq!(write(&["--overwrite"]).code, 0);
    let names = std::fs::read_dir(folder.path()).unwrap();
    assert_eq!(names.count(), 3, "no half-written file");
}
