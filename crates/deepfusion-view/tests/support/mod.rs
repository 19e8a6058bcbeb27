//! A small folder of results, a server on it, and a plain client.

#[cfg(unix)]
pub(crate) mod browser;

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use deepfusion_geometry::DepthMap;
use deepfusion_view::{Folder, Server, Settings};
use serde_json::{Value, json};

/// The generated pictures' size.
pub(crate) const SIZE: (u32, u32) = (96, 48);
/// fx, fy, cx, cy of the generated camera.
pub(crate) const CAMERA: [f64; 4] = [60.0, 58.0, 47.0, 22.5];

/// Steps of 1/256 m at a pixel of frame `i`: a slope with a hole, different in every frame.
pub(crate) fn steps(i: usize, x: u32, y: u32) -> u16 {
    if x < 4 && y < 4 {
        0
    } else {
        (1500 + 37 * x + 11 * y + 5 * i as u32) as u16
    }
}

/// The target of frame `i`, in camera axes: it comes nearer by half a metre per frame.
pub(crate) fn target(i: usize) -> Value {
    json!({
        "id": 7, "center_m": [1.0, 0.5, 14.0 - 0.5 * i as f64], "size_m": [4.0, 1.8, 1.5], "yaw_rad": 0.6, "distance_m": 14.0,
        "velocity_mps": [0.0, 0.0, -5.0], "moving": true, "confidence": 0.9,
    })
}

/// Writes frame `i` as `perceive` does: a picture, depth, targets, and the sidecar last.
pub(crate) fn write_frame(folder: &Path, i: usize) {
    let (width, height) = SIZE;
    let name = format!("{i:06}");
    // A colour that nothing else in the page has.
    let image =
        image::RgbImage::from_fn(width, height, |x, _| image::Rgb([230, (x % 8) as u8, 220]));
    image
        .save(folder.join(format!("{name}_image.png")))
        .unwrap();
    let depth = DepthMap {
        width: width as usize,
        height: height as usize,
        data: (0..height)
            .flat_map(|y| (0..width).map(move |x| f32::from(steps(i, x, y)) / 256.0))
            .collect(),
    };
    deepfusion_images::write_depth_png(&depth, &folder.join(format!("{name}_depth.png"))).unwrap();
    let targets = json!({
        "frame": name, "time_s": 0.1 * i as f64, "targets": [target(i)],
        "ground": {"normal": [0.0, -1.0, 0.0], "offset_m": 1.5},
        "camera_motion": [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.2 * i as f64],
        "speed_mps": 2.0, "time_to_collision_s": null, "scale_monitor": null, "latency_ms": 12.0,
    });
    std::fs::write(
        folder.join(format!("{name}_targets.json")),
        targets.to_string(),
    )
    .unwrap();
    write_sidecar(folder, &name, &json!({}));
}

/// Writes a sidecar, with some fields replaced.
pub(crate) fn write_sidecar(folder: &Path, name: &str, replaced: &Value) {
    let mut sidecar = json!({
        "image": "gone/street.mp4", "size": [SIZE.0, SIZE.1], "unit": "metres along the camera's axis (z)", "intrinsics": CAMERA,
        "intrinsics_from": "given", "scale_trusted": true, "focal_factor": 1.0, "window": [0, 0, SIZE.0, SIZE.1], "depth_m": [5.9, 21.0],
    });
    for (key, value) in replaced.as_object().unwrap() {
        sidecar[key] = value.clone();
    }
    std::fs::write(folder.join(format!("{name}.json")), sidecar.to_string()).unwrap();
}

/// A folder of `count` frames.
pub(crate) fn results(count: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    (0..count).for_each(|i| write_frame(folder.path(), i));
    folder
}

/// A running server, which stops when this value is dropped.
pub(crate) struct Running {
    pub address: SocketAddr,
    pub url: String,
    stop: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Running {
    pub(crate) fn start(folder: &Path, other: Option<&Path>) -> Self {
        let open = |p: &Path| Folder::open(p).unwrap();
        let server = Server::bind(any_port(), open(folder), other.map(open)).unwrap();
        let (address, url) = (server.address(), server.url());
        let stop = Arc::new(AtomicBool::new(false));
        let asked = stop.clone();
        let thread = std::thread::spawn(move || server.run_until(|| asked.load(Ordering::SeqCst)));
        Self {
            address,
            url,
            stop,
            thread: Some(thread),
        }
    }

    /// Status and body of a path.
    pub(crate) fn get(&self, path: &str) -> (u16, Vec<u8>) {
        let request = format!(
            "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n",
            self.address
        );
        self.raw(request.as_bytes())
    }

    /// The JSON of a path, which must exist.
    pub(crate) fn json(&self, path: &str) -> Value {
        let (status, body) = self.get(path);
        assert_eq!(status, 200, "{path}: {}", String::from_utf8_lossy(&body));
        serde_json::from_slice(&body).unwrap()
    }

    /// Status and body of the answer to these bytes.
    pub(crate) fn raw(&self, request: &[u8]) -> (u16, Vec<u8>) {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(20)))
            .unwrap();
        stream.write_all(request).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        split(&answer)
    }
}

/// An answer's status and body.
pub(crate) fn split(answer: &[u8]) -> (u16, Vec<u8>) {
    let end = answer
        .windows(4)
        .position(|w| w == b"\r\n\r\n")
        .expect("a head");
    let head = String::from_utf8_lossy(&answer[..end]);
    let status = head.split(' ').nth(1).unwrap().parse().unwrap();
    (status, answer[end + 4..].to_vec())
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

/// This machine, on any free port.
pub(crate) fn any_port() -> Settings {
    Settings {
        host: [127, 0, 0, 1].into(),
        port: 0,
    }
}
