//! As much of HTTP/1.1 as one page needs: GET and HEAD, connections that stay open, limits on everything a client chooses.

mod connection;
mod request;
mod response;

pub(crate) use connection::serve;
pub(crate) use request::Request;
pub(crate) use response::Response;
