//! [`Local`]: answers the page's requests in the page's own browser, without HTTP, threads and
//! clocks. The page decides when control steps are due.

use crate::base::error::Error;
use crate::serve::http::Request;
use crate::serve::refusal::HttpRefusal;
use crate::serve::request::{ChangeRequest, RolloutPlan};
use crate::serve::routes::{self, Reply};
use crate::serve::simulation::{Event, Walk};
use crate::serve::team::TeamWalk;
use crate::serve::{Service, request, stream};
use crate::shipped::gallery;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::atomic::AtomicBool;

/// The page's service and its running simulations in one worker of a browser.
pub struct Local {
    service: Service,
    simulations: BTreeMap<u64, Simulation>,
    begun: u64,
}

enum Simulation {
    Robot(Box<(RolloutPlan, Walk)>),
    Team(Box<TeamWalk>),
}

/// Nobody stops a control step in its middle: the worker has one thread.
static NEVER: AtomicBool = AtomicBool::new(false);

impl Local {
    /// Offers the robots of a text that `morphcog site` writes; a build with robots of its own offers
    /// those.
    ///
    /// # Errors
    /// Returns an error if the text is something else.
    pub fn open(robots: &str) -> Result<Self, Error> {
        gallery::provide(robots).map_err(Error::input)?;
        Service::shipped().map(Local::with)
    }

    pub(crate) fn with(service: Service) -> Self {
        Local {
            service,
            simulations: BTreeMap::new(),
            begun: 0,
        }
    }

    /// Simulates a robot to its end, and returns how far it moves \[voxel lengths\].
    pub(crate) fn walk(&mut self, request: &str) -> Result<f64, Error> {
        let said =
            |(_, line): (u16, Vec<u8>)| Error::other(String::from_utf8_lossy(&line).into_owned());
        let begun = self.begin("/api/simulations", request.as_bytes(), &[]);
        let (id, _) = begun.map_err(said)?;
        let Some(Simulation::Robot(robot)) = self.simulations.get_mut(&id) else {
            return Err(Error::other(
                "expected the simulation of a robot".to_string(),
            ));
        };
        let (_, walk) = &mut **robot;
        let moments = walk.advance(walk.until, &NEVER, || false);
        self.end(id);
        Ok(moments.answer.moved)
    }

    /// Answers a request: an HTTP status, and JSON or one line on what is wrong.
    pub fn answer(&mut self, method: &str, target: &str, body: &[u8]) -> (u16, Vec<u8>) {
        if let ("POST", ["api", "simulations", id]) = (method, parts(target).as_slice()) {
            let changed = self.change(id, body);
            return changed.map_or_else(refused, |events| (200, events.into_bytes()));
        }
        match routes::reply(&self.service, &Request::new(method, target, body)) {
            Reply::Whole(response) => response.into_parts(),
            Reply::Simulation(_) | Reply::Team(_) => refused(HttpRefusal::Wrong(
                "expected a simulation to begin".to_string(),
            )),
        }
    }

    /// Begins the simulation of a robot, or of those members of a team that have these numbers.
    /// Returns its number and its first event.
    ///
    /// # Errors
    /// Returns an HTTP status and one line on what is wrong.
    pub fn begin(
        &mut self,
        target: &str,
        body: &[u8],
        members: &[usize],
    ) -> Result<(u64, String), (u16, Vec<u8>)> {
        let id = self.begun + 1;
        let reply = routes::reply(&self.service, &Request::new("POST", target, body));
        let (simulation, event) = match reply {
            Reply::Whole(response) => return Err(response.into_parts()),
            Reply::Simulation(plan) => {
                let walk = Walk::new(&plan);
                let event = stream::text(&walk.begins(id, &plan));
                (Simulation::Robot(Box::new((*plan, walk))), event)
            }
            Reply::Team(plan) => {
                let walk = TeamWalk::new(&plan, |number| members.contains(&number));
                let event = stream::of_team(&walk.begins(id, &plan));
                (Simulation::Team(Box::new(walk)), event)
            }
        };
        self.begun = id;
        self.simulations.insert(id, simulation);
        Ok((id, event))
    }

    /// Simulates control steps, and returns the events. A robot's simulation is forgotten at its end;
    /// a team's is needed for [`Local::tally`].
    pub fn advance(&mut self, id: u64, due: u32) -> String {
        let mut events = String::new();
        match self.simulations.get_mut(&id) {
            None => {}
            Some(Simulation::Robot(robot)) => {
                let (_, walk) = &mut **robot;
                let moments = walk.advance(due, &NEVER, || false);
                let tell = |event: Event| -> Result<(), Infallible> {
                    events += &stream::text(&event);
                    Ok(())
                };
                let Ok(ended) = moments.report(walk.step, tell);
                if ended {
                    self.simulations.remove(&id);
                }
            }
            Some(Simulation::Team(team)) => {
                team.advance(due, &NEVER, |walkers, walk| {
                    walkers.iter_mut().for_each(walk)
                });
                events += &stream::of_team(&team.moment());
                if team.is_over() {
                    events += &stream::of_team(&team.ends());
                }
            }
        }
        events
    }

    /// Counts the votes of a team whose robots have moved so far, in voxel lengths, some of them in
    /// other workers; `None` is unstable. Returns JSON: null if there is no such simulation.
    pub fn tally(&self, id: u64, moved: Vec<Option<f64>>) -> String {
        let tally = match self.simulations.get(&id) {
            Some(Simulation::Team(team)) => Some(team.tally_of(moved)),
            _ => None,
        };
        serde_json::to_string(&tally).expect("JSON has all of it")
    }

    /// Ends a simulation.
    pub fn end(&mut self, id: u64) {
        self.simulations.remove(&id);
    }

    /// Shows a simulation something else. Its pace is the page's.
    fn change(&mut self, id: &str, body: &[u8]) -> Result<String, HttpRefusal> {
        let ChangeRequest { shown, .. } = request::read(body)?;
        let number = id.parse().ok();
        let found = number.and_then(|id: u64| self.simulations.get_mut(&id));
        let simulation =
            found.ok_or_else(|| HttpRefusal::Unknown(format!("there is no simulation {id}")))?;
        match (simulation, shown) {
            (Simulation::Robot(robot), Some(shown)) => {
                let (plan, walk) = &mut **robot;
                let seen = shown.seen(&plan.who, &self.service.images)?;
                Ok(stream::text(&walk.look_at(&seen)))
            }
            _ => Ok(String::new()),
        }
    }
}

fn parts(target: &str) -> Vec<&str> {
    target.split('/').skip(1).collect()
}

fn refused(refusal: HttpRefusal) -> (u16, Vec<u8>) {
    routes::refused(refusal).into_parts()
}
