//! The subset of HTTP/1.1 that one page needs: GET and HEAD, persistent connections, limits on everything a client chooses.

mod connection;
mod request;
mod response;

pub(crate) use connection::serve;
pub(crate) use request::Request;
pub(crate) use response::Response;
