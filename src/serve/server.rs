//! `morphcog serve`: serves the page and its requests over HTTP, on this machine only.

use crate::base::error::Error;
use crate::base::remedy::Remedy;
use crate::base::threads;
use crate::serve::catalogue::Who;
use crate::serve::hosts::Hosts;
use crate::serve::http::HttpResponse;
use crate::serve::routes::Reply;
use crate::serve::simulation::{Gone, live};
use crate::serve::simulations::{Control, Slot};
use crate::serve::{Service, http, routes, stream, team};
use std::io::{self, ErrorKind, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Maximum number of connections at once; a browser needs about six.
const MAX_CONNECTIONS: usize = 64;
/// Time limit for simulations to end when the server ends.
const TO_END: Duration = Duration::from_secs(2);
/// Time between checks if the server should end.
const LOOK: Duration = Duration::from_millis(50);

/// A server that is bound to its port.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    site: Arc<Site>,
}

/// Everything that a connection needs.
struct Site {
    service: Service,
    /// The names under which the page may be reached.
    hosts: Hosts,
    /// The threads in which the robots of teams walk.
    pool: rayon::ThreadPool,
}

impl Server {
    /// Binds a port that only this machine can reach; 0 means any free port. `hosts` are the names
    /// under which the page may be reached.
    ///
    /// # Errors
    /// Returns an error if the port is taken or the system refuses.
    pub fn bind(service: Service, hosts: Hosts, port: u16) -> Result<Self, Error> {
        let refuse = |error: std::io::Error| match error.kind() {
            std::io::ErrorKind::AddrInUse => {
                Error::occupied(format!("port {port} is taken by another program"))
                    .remedy(Remedy::ChoosePort)
            }
            _ => Error::other(format!("port {port} of 127.0.0.1 cannot be used: {error}")),
        };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refuse)?;
        let address = listener.local_addr().map_err(refuse)?;
        Ok(Server {
            listener,
            address,
            site: Arc::new(Site {
                service,
                hosts,
                pool: threads::pool(None)?,
            }),
        })
    }

    /// Returns the page's URL.
    pub fn url(&self) -> String {
        format!("http://{}/", self.address)
    }

    /// Serves until `stop` is set, then ends all simulations.
    ///
    /// # Errors
    /// Returns an error if the system has no thread left.
    pub fn run(self, stop: &AtomicBool) -> Result<(), Error> {
        let Server {
            listener,
            address,
            site,
        } = self;
        let simulations = &site.service.simulations;
        let ended = Arc::new(AtomicBool::new(false));
        let (own, over) = (Arc::clone(&site), Arc::clone(&ended));
        threads::start("server", move || accept(&listener, &own, &over))?;
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(LOOK);
        }
        ended.store(true, Ordering::Relaxed);
        simulations.close();
        // Wakes the accepting thread, so that it notices.
        drop(TcpStream::connect_timeout(&address, LOOK));
        let until = Instant::now() + TO_END;
        while simulations.running() > 0 && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(())
    }
}

fn accept(listener: &TcpListener, site: &Arc<Site>, ended: &AtomicBool) {
    let connections = Arc::new(AtomicUsize::new(0));
    for stream in listener.incoming() {
        if ended.load(Ordering::Relaxed) {
            return;
        }
        let Ok(mut stream) = stream else {
            // Too many open files, or a connection that closed at once; later ones may succeed.
            std::thread::sleep(LOOK);
            continue;
        };
        if connections.fetch_add(1, Ordering::AcqRel) >= MAX_CONNECTIONS {
            connections.fetch_sub(1, Ordering::AcqRel);
            let busy = HttpResponse::refusal(503, "too many connections at once");
            let _ = stream
                .set_write_timeout(Some(LOOK))
                .and_then(|()| busy.send(&mut stream, false));
            continue;
        }
        let place = Place(Arc::clone(&connections));
        let site = Arc::clone(site);
        // If the system has no thread left, the connection closes and its slot is freed.
        let _ = threads::start("connection", move || {
            let _place = place;
            connection(&site, &mut stream);
        });
    }
}

/// A slot among the connections, freed however the connection ends.
struct Place(Arc<AtomicUsize>);

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

fn connection(site: &Site, stream: &mut TcpStream) {
    let service = &site.service;
    let read = http::read(stream).and_then(|request| match request {
        Some(request) => site.hosts.check(&request).map(|()| Some(request)),
        None => Ok(None),
    });
    let (response, head_only) = match read {
        Ok(None) => return,
        Err(refusal) => (refusal, false),
        Ok(Some(request)) => match routes::reply(service, &request) {
            Reply::Whole(response) => (response, request.method == "HEAD"),
            Reply::Simulation(plan) => {
                let lives = |slot: &Slot, tell: &mut Tell| {
                    live(slot, &plan, |event| tell(&stream::text(&event)))
                };
                let Some(refusal) = simulation(service, &plan.who, lives, stream) else {
                    return;
                };
                (refusal, false)
            }
            Reply::Team(plan) => {
                let lives = |slot: &Slot, tell: &mut Tell| {
                    team::live(slot, &plan, &site.pool, |event| {
                        tell(&stream::of_team(&event))
                    })
                };
                // A team takes one slot.
                let Some(refusal) = simulation(service, &plan.members[0].1, lives, stream) else {
                    return;
                };
                (refusal, false)
            }
        },
    };
    // If the page was closed, nobody reads the error.
    if response.send(stream, head_only).is_ok() {
        http::close(stream);
    }
}

type Tell<'a> = dyn FnMut(&str) -> Result<(), Gone> + 'a;

/// Runs a simulation as long as the connection lasts, or returns the refusal to send.
fn simulation(
    service: &Service,
    who: &Who,
    lives: impl FnOnce(&Slot, &mut Tell) -> Result<(), Gone>,
    stream: &mut TcpStream,
) -> Option<HttpResponse> {
    let slot = match service.simulations.begin(who.clone()) {
        Ok(slot) => slot,
        Err(refusal) => return Some(routes::refused(refusal)),
    };
    if let Err(error) = end_with(stream, &slot.control) {
        return Some(HttpResponse::refusal(503, &error.to_string()));
    }
    let begun = http::begin_events(stream).map_err(|_| Gone);
    let told = begun.and_then(|()| {
        lives(&slot, &mut |event: &str| {
            stream.write_all(event.as_bytes()).map_err(|_| Gone)
        })
    });
    // Stops the thread that watches the connection.
    slot.control.end();
    drop(slot);
    if told.is_ok() {
        http::close(stream);
    }
    None
}

/// Ends a simulation when the client closes its connection. A failed write would notice only later,
/// and meanwhile the simulation would go on.
fn end_with(stream: &TcpStream, control: &Arc<Control>) -> Result<(), Error> {
    let failed =
        |error: io::Error| Error::other(format!("the connection cannot be watched: {error}"));
    let (stream, control) = (stream.try_clone().map_err(failed)?, Arc::clone(control));
    stream.set_read_timeout(Some(LOOK)).map_err(failed)?;
    let watch = move || {
        while !control.is_over() {
            match stream.peek(&mut [0]) {
                // The client keeps sending.
                Ok(count) if count > 0 => std::thread::sleep(LOOK),
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Ok(_) | Err(_) => control.end(),
            }
        }
    };
    threads::start("watch", watch).map(|_| ())
}
