//! [`Hosts`]: the names under which a browser may reach the page.

use crate::serve::http::{HttpResponse, Request};
use std::net::IpAddr;
use std::str::FromStr;

/// The names under which a browser may reach the page: those of this machine, on any port, because
/// a tunnel has its own; and those that the user allows, such as a proxy's.
#[derive(Clone, Debug, Default)]
pub struct Hosts {
    allowed: Vec<HostName>,
    /// Tells users how to allow another name.
    advice: &'static str,
}

/// The name or address of a host, without a port, in lower case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct HostName(String);

impl FromStr for HostName {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let is_part = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        let is_name = !text.is_empty() && text.chars().all(is_part);
        match is_name || address(text).is_some() {
            true => Ok(HostName(text.to_ascii_lowercase())),
            false => {
                Err("expected a host's name without http:// and without a port, such as hub.example.org"
                    .to_string())
            }
        }
    }
}

/// Parses an address as written in a URL: IPv6 in brackets.
fn address(host: &str) -> Option<IpAddr> {
    match host
        .strip_prefix('[')
        .and_then(|rest| rest.strip_suffix(']'))
    {
        Some(inner) => inner.parse().ok().map(IpAddr::V6),
        None => host.parse().ok().map(IpAddr::V4),
    }
}

/// Returns the host of a Host header, without the port, or `None` if the header is invalid.
fn host_of(header: &str) -> Option<HostName> {
    let (host, port) = match header.rsplit_once(':') {
        // The colon is not inside an IPv6 address.
        Some((host, port)) if !port.ends_with(']') => (host, port),
        _ => (header, "80"),
    };
    let is_port = port.bytes().all(|b| b.is_ascii_digit()) && port.parse::<u16>().is_ok();
    if is_port { host.parse().ok() } else { None }
}

impl Hosts {
    /// Allows this machine's names and `allowed`; `advice` tells how to allow another one.
    pub(crate) fn new(allowed: Vec<HostName>, advice: &'static str) -> Self {
        Hosts { allowed, advice }
    }

    /// Checks that a request is for this page and comes from it. It refuses names that other sites
    /// point at this machine (DNS rebinding), and requests from other sites' pages.
    pub(crate) fn check(&self, request: &Request) -> Result<(), HttpResponse> {
        let Some(host) = request.header("host")? else {
            return Err(HttpResponse::refusal(400, "expected a Host header"));
        };
        if !host_of(host).is_some_and(|name| self.allows(&name)) {
            let text = format!(
                "Host: {host}: expected localhost or 127.0.0.1; {}",
                self.advice
            );
            return Err(HttpResponse::refusal(403, &text));
        }
        // Programs like curl send no Origin; browsers always do where it matters.
        let origin = request
            .header("origin")?
            .filter(|_| request.method == "POST");
        // A proxy may use https where this server does not.
        let is_own = |origin: &str| {
            let sender = origin
                .strip_prefix("http://")
                .or_else(|| origin.strip_prefix("https://"));
            sender.is_some_and(|sender| sender.eq_ignore_ascii_case(host))
        };
        match origin {
            Some(origin) if !is_own(origin) => {
                let text = format!(
                    "Origin: {origin}: requests from other sites are refused, and this page is at {host}; \
                     a proxy has to pass on the Host header as it is"
                );
                Err(HttpResponse::refusal(403, &text))
            }
            _ => Ok(()),
        }
    }

    fn allows(&self, HostName(name): &HostName) -> bool {
        name == "localhost"
            || address(name).is_some_and(|address| address.is_loopback())
            || self.allowed.iter().any(|HostName(allowed)| allowed == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_this_machine_are_allowed_on_any_port_and_others_only_if_the_user_says_so() {
        let hosts = Hosts::new(vec!["Hub.example.org".parse().unwrap()], "");
        let allows = |header: &str| host_of(header).is_some_and(|name| hosts.allows(&name));
        for own in [
            "localhost",
            "LOCALHOST:9000",
            "127.0.0.1:1",
            "127.0.0.1",
            "[::1]",
            "[::1]:65535",
        ] {
            assert!(allows(own), "{own}");
        }
        assert!(allows("hub.example.org") && allows("HUB.example.org:8443"));
        for other in [
            "",
            ":80",
            "evil.example:80",
            "localhost.evil.example",
            "evil.localhost",
            "localhost:",
            "localhost:x",
            "localhost:65536",
            "localhost:+80",
            "localhost:80:80",
            "me@localhost",
            "localhost@evil.example",
            "localhost/",
            "localhost ",
            "0.0.0.0",
            "127.1",
            "2130706433",
            "10.0.0.1:80",
            "::1",
            "[::1",
            "[::2]",
            "[127.0.0.1]",
            "hub.example.org.evil.example",
            "evil.hub.example.org",
        ] {
            assert!(!allows(other), "{other}");
        }
    }

    #[test]
    fn a_name_has_neither_scheme_nor_port_nor_wildcard() {
        for wrong in [
            "",
            "http://hub",
            "hub:80",
            "hub/",
            "*",
            "*.example.org",
            "a b",
            "größe",
            "[x]",
        ] {
            assert!(wrong.parse::<HostName>().is_err(), "{wrong}");
        }
        for right in ["hub", "hub-1.example.org", "10.0.0.1", "[fe80::1]"] {
            assert!(right.parse::<HostName>().is_ok(), "{right}");
        }
    }
}
