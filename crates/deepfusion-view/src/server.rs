//! The server of the page.

use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use crate::http::{self, Response};
use crate::routes::Routes;
use crate::{Error, Folder, Result};

/// A browser opens six connections per page; this is enough for several tabs and phones.
const MOST_CONNECTIONS: usize = 64;

/// The address to listen on.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// The address; an unspecified one means all networks.
    pub host: IpAddr,
    /// The port; 0 takes any free one.
    pub port: u16,
}

/// A listening server of one page.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    routes: Arc<Routes>,
}

impl Server {
    /// Starts to listen, to serve one folder or two side by side. Requests are answered only by [`Server::run_until`].
    ///
    /// # Errors
    /// [`Error::PortInUse`], [`Error::Listen`]; [`Error::OtherKind`] if one folder is a run and the other is not.
    pub fn bind(settings: Settings, folder: Folder, other: Option<Folder>) -> Result<Self> {
        if let Some(other) = &other
            && other.kind() != folder.kind()
        {
            return Err(Error::OtherKind {
                path: other.path().to_owned(),
                found: other.kind(),
                expected: folder.kind(),
            });
        }
        let asked = SocketAddr::new(settings.host, settings.port);
        let failed = |source: std::io::Error| match source.kind() {
            std::io::ErrorKind::AddrInUse => Error::PortInUse { address: asked },
            _ => Error::Listen {
                address: asked,
                source,
            },
        };
        let listener = TcpListener::bind(asked).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let folders = std::iter::once(folder).chain(other).collect();
        Ok(Self {
            listener,
            address,
            routes: Arc::new(Routes::new(folders, address.ip().is_loopback())),
        })
    }

    /// The address it listens on, with the actual port.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The page's address on this machine.
    #[must_use]
    pub fn url(&self) -> String {
        let here = self.url_address();
        format!("http://{here}/")
    }

    /// The page's address for other machines; `None` if only this machine is served, or there is no network.
    #[must_use]
    pub fn url_for_others(&self) -> Option<String> {
        if !self.address.ip().is_unspecified() {
            return None;
        }
        // "Connecting" a datagram socket sends nothing; it only selects the machine's address on the route to the outside.
        // 192.0.2.1 is reserved for documentation (RFC 5737).
        let probe = std::net::UdpSocket::bind(("0.0.0.0", 0)).ok()?;
        probe.connect(("192.0.2.1", 9)).ok()?;
        let ip = probe.local_addr().ok()?.ip();
        (!ip.is_loopback()).then(|| format!("http://{}/", SocketAddr::new(ip, self.address.port())))
    }

    /// Serves until `stop` returns true; it is polled ten times a second.
    pub fn run_until(self, stop: impl Fn() -> bool) {
        let ended = Arc::new(AtomicBool::new(false));
        let (acceptor_ended, address) = (ended.clone(), self.url_address());
        let acceptor = std::thread::spawn(move || self.accept(&acceptor_ended));
        while !stop() && !acceptor.is_finished() {
            std::thread::sleep(Duration::from_millis(100));
        }
        ended.store(true, Ordering::SeqCst);
        // Wakes the acceptor.
        let _ = TcpStream::connect_timeout(&address, Duration::from_secs(1));
        let _ = acceptor.join();
    }

    fn url_address(&self) -> SocketAddr {
        let mut address = self.address;
        if address.ip().is_unspecified() {
            address.set_ip(match address.ip() {
                IpAddr::V4(_) => IpAddr::from([127, 0, 0, 1]),
                IpAddr::V6(_) => IpAddr::V6(std::net::Ipv6Addr::LOCALHOST),
            });
        }
        address
    }

    fn accept(&self, ended: &AtomicBool) {
        let open = Arc::new(AtomicUsize::new(0));
        loop {
            let accepted = self.listener.accept();
            if ended.load(Ordering::SeqCst) {
                return;
            }
            let mut stream = match accepted {
                Ok((stream, _)) => stream,
                Err(error) => {
                    // Probably out of file handles, until other connections are closed.
                    tracing::warn!("cannot accept a connection: {error}");
                    std::thread::sleep(Duration::from_millis(100));
                    continue;
                }
            };
            if open.load(Ordering::SeqCst) >= MOST_CONNECTIONS {
                let busy =
                    Response::problem(503, "too many connections", Some("close a tab or two"));
                let _ = stream.set_write_timeout(Some(Duration::from_secs(1)));
                let _ = busy.write(&mut stream, false, false);
                continue;
            }
            let one = Counted::new(&open);
            let routes = self.routes.clone();
            let spawned = std::thread::Builder::new()
                .name("view".into())
                .spawn(move || {
                    let _one = one;
                    // A client that disconnects is not an error.
                    let _ = http::serve(stream, &|request| routes.answer(request));
                });
            if let Err(error) = spawned {
                tracing::warn!("cannot serve a connection: {error}");
            }
        }
    }
}

/// An open connection, counted while it lives.
struct Counted(Arc<AtomicUsize>);

impl Counted {
    fn new(count: &Arc<AtomicUsize>) -> Self {
        count.fetch_add(1, Ordering::SeqCst);
        Self(count.clone())
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}
