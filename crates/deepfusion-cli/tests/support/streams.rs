//! Streams of frames that encode their numbers, and ways to send them.

use std::ffi::OsStr;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread::JoinHandle;

use super::Run;

const SIZE: (usize, usize) = (320, 96);

/// Brightness of a frame of [`stream`], as RGB, which encodes its number.
pub(crate) fn brightness(number: usize) -> u8 {
    // A video's black is 16, and its white 235.
    ((u32::from(luma(number)) - 16) * 255 / 219) as u8
}

fn luma(number: usize) -> u8 {
    (16 + number * 37 % 200) as u8
}

/// Frames of uniform grey, as YUV4MPEG.
pub(crate) fn stream(frames: usize) -> Vec<u8> {
    stream_of(SIZE, frames)
}

/// As [`stream`], of another size; both sides are even.
pub(crate) fn stream_of((w, h): (usize, usize), frames: usize) -> Vec<u8> {
    let mut bytes = format!("YUV4MPEG2 W{w} H{h} F30:1 Ip A1:1 C420jpeg\n").into_bytes();
    for number in 0..frames {
        bytes.extend(b"FRAME\n");
        bytes.resize(bytes.len() + w * h, luma(number));
        bytes.resize(bytes.len() + w * h / 2, 128);
    }
    bytes
}

/// Runs the program with a stream on its standard input, sent as fast as it is read.
pub(crate) fn piped(folder: &Path, args: &str, bytes: Vec<u8>) -> Run {
    let mut child = Command::new(env!("CARGO_BIN_EXE_deepfusion"))
        .current_dir(folder)
        .args(args.split_whitespace())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    // The program may stop reading before the end.
    let sender = std::thread::spawn(move || input.write_all(&bytes).ok());
    let output = child.wait_with_output().unwrap();
    sender.join().unwrap();
    run_of(output)
}

/// Runs the program with another search path for programs.
pub(crate) fn with_path(folder: &Path, args: &str, path: &OsStr) -> Run {
    let mut command = Command::new(env!("CARGO_BIN_EXE_deepfusion"));
    command.current_dir(folder).args(args.split_whitespace());
    run_of(command.env("PATH", path).output().unwrap())
}

fn run_of(output: Output) -> Run {
    Run {
        code: output.status.code().unwrap(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Answers one request as a camera's server would, and passes the connection to the test.
pub(crate) fn serve(answer: impl FnOnce(TcpStream) + Send + 'static) -> (String, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/live", listener.local_addr().unwrap());
    let server = std::thread::spawn(move || {
        let (mut connection, _) = listener.accept().unwrap();
        let mut request = [0; 4096];
        assert!(connection.read(&mut request).unwrap() > 0);
        let head = "HTTP/1.1 200 OK\r\nContent-Type: video/x-yuv4mpeg\r\nContent-Length: 1000000000\r\n\r\n";
        connection.write_all(head.as_bytes()).unwrap();
        answer(connection);
    });
    (address, server)
}
