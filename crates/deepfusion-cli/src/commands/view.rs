use std::io::IsTerminal;
use std::process::{Command, Stdio};

use deepfusion_hint::count_of;
use deepfusion_view::{Folder, Server, Settings};

use crate::cli::ViewArgs;
use crate::failure::Result;
use crate::progress::say;
use crate::{interrupt, output};

/// `deepfusion view`.
pub(super) fn run(args: &ViewArgs) -> Result<()> {
    if let Some(file) = &args.rerun {
        return super::view_rerun::run(args, file);
    }
    let folder = Folder::open(&args.folder)?;
    let other = args.other.as_deref().map(Folder::open).transpose()?;
    let contents = if folder.is_training_run() {
        "no predictions in this run: showing its learning curve and panels".to_owned()
    } else {
        let frames = count_of(folder.frames(), "frame");
        format!("{frames} in {}", args.folder.display())
    };
    let settings = Settings {
        host: args.host,
        port: args.port,
    };
    let server = Server::bind(settings, folder, other)?;
    interrupt::catch("stopping");
    output::print(&format!("{}\n", server.url()))?;
    if let Some(url) = server.url_for_others() {
        say(&format!("for other machines: {url}"));
    }
    say(&format!("{contents}; stop with Ctrl-C"));
    // A script that reads the address does not want a window.
    if !args.no_open && std::io::stdout().is_terminal() {
        open_browser(&server.url());
    }
    server.run_until(interrupt::asked);
    Ok(())
}

/// Opens the page if there is a screen. Failing to is no error, since the address was printed.
fn open_browser(url: &str) {
    let mut command = if cfg!(target_os = "macos") {
        Command::new("open")
    } else if cfg!(windows) {
        let mut command = Command::new("cmd");
        command.args(["/C", "start", ""]);
        command
    } else if ["DISPLAY", "WAYLAND_DISPLAY"]
        .iter()
        .any(|v| std::env::var_os(v).is_some())
    {
        Command::new("xdg-open")
    } else {
        return;
    };
    let started = command
        .arg(url)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    if let Ok(mut opener) = started {
        // It ends at once. Waiting for it avoids a zombie process while the server runs.
        std::thread::spawn(move || opener.wait());
    }
}
