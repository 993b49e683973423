//! Dispatches requests to their answers.

use crate::body::Body;
use crate::draw::html::{materials, named};
use crate::serve::assets::asset;
use crate::serve::http::{HttpResponse, Request};
use crate::serve::refusal::HttpRefusal;
use crate::serve::request::{ChangeRequest, Pace, RolloutPlan, SeeRequest, SimulationRequest};
use crate::serve::stream::seen_pixels;
use crate::serve::team::{TeamPlan, TeamRequest};
use crate::serve::{Service, request, team};
use serde::Deserialize;
use serde_json::json;

pub(crate) enum Reply {
    Whole(HttpResponse),
    Simulation(Box<RolloutPlan>),
    Team(Box<TeamPlan>),
}

pub(crate) fn reply(service: &Service, request: &Request) -> Reply {
    let parts: Vec<&str> = request.path.split('/').skip(1).collect();
    let get = matches!(request.method.as_str(), "GET" | "HEAD");
    let post = request.method == "POST";
    let reading = |answer: &dyn Fn() -> Result<HttpResponse, HttpRefusal>| {
        let answer = if get {
            answer().unwrap_or_else(refused)
        } else {
            HttpResponse::wrong_method("GET, HEAD")
        };
        Reply::Whole(answer)
    };
    let posting = |answer: &dyn Fn() -> Result<HttpResponse, HttpRefusal>| {
        let answer = if post {
            answer().unwrap_or_else(refused)
        } else {
            HttpResponse::wrong_method("POST")
        };
        Reply::Whole(answer)
    };
    match parts.as_slice() {
        ["api", "status"] => reading(&|| Ok(HttpResponse::json(&service.status()))),
        ["api", "materials"] => reading(&|| Ok(HttpResponse::json(&materials()))),
        ["api", "archives"] => reading(&|| Ok(HttpResponse::json(&service.catalogue.list()))),
        ["api", "archives", index] => reading(&|| archive(service, index)),
        ["api", "archives", index, "progress"] => reading(&|| {
            Ok(HttpResponse::json(
                &service.catalogue.course(number(index, "archive")?)?,
            ))
        }),
        ["api", "images"] => reading(&|| images(service, request)),
        ["api", "body"] => posting(&|| {
            #[derive(Deserialize)]
            #[serde(deny_unknown_fields)]
            struct Posted {
                #[serde(deserialize_with = "request::self_moving")]
                body: Body,
            }
            let Posted { body } = request::read(&request.body)?;
            Ok(HttpResponse::json(&service.check(&body)))
        }),
        ["api", "stimulus"] => posting(&|| {
            let asked: SeeRequest = request::read(&request.body)?;
            let seen = asked.seen(&service.catalogue, &service.images)?;
            Ok(HttpResponse::json(&seen_pixels(&seen)))
        }),
        ["api", "scenario"] => posting(&|| {
            let text = std::str::from_utf8(&request.body);
            let text =
                text.map_err(|_| HttpRefusal::Wrong("scenario: not UTF-8 text".to_string()))?;
            Ok(HttpResponse::json(&service.load(text)?))
        }),
        ["api", "simulations"] if post => {
            let plan = request::read::<SimulationRequest>(&request.body)
                .and_then(|asked| service.plan(asked));
            plan.map_or_else(
                |refusal| Reply::Whole(refused(refusal)),
                |plan| Reply::Simulation(Box::new(plan)),
            )
        }
        ["api", "team"] if post => {
            let asked = request::read::<TeamRequest>(&request.body);
            let plan = asked.and_then(|asked| asked.plan(&service.catalogue, &service.images));
            plan.map_or_else(
                |refusal| Reply::Whole(refused(refusal)),
                |plan| Reply::Team(Box::new(plan)),
            )
        }
        ["api", "team"] => reading(&|| {
            let collections = service.catalogue.collections();
            let members = team::members(&collections);
            let classes = team::classes(members.iter().map(|member| &member.judge));
            let mut words = json!({ "members": members, "classes": classes });
            named(&mut words, &team::class_names(&members, &collections));
            Ok(HttpResponse::json(&words))
        }),
        ["api", "simulations"] => Reply::Whole(HttpResponse::wrong_method("POST")),
        ["api", "simulations", id] => posting(&|| change(service, id, &request.body)),
        _ => match asset(&request.path) {
            Some(_) if !get => Reply::Whole(HttpResponse::wrong_method("GET, HEAD")),
            Some(file) => Reply::Whole(file),
            None => Reply::Whole(HttpResponse::refusal(
                404,
                "there is nothing here; the page is at /",
            )),
        },
    }
}

pub(crate) fn refused(refusal: HttpRefusal) -> HttpResponse {
    let status = match refusal {
        HttpRefusal::Wrong(_) => 400,
        HttpRefusal::Unknown(_) => 404,
        HttpRefusal::Busy(_) => 503,
    };
    HttpResponse::refusal(status, &refusal.to_string())
}

fn number<T: std::str::FromStr>(text: &str, what: &str) -> Result<T, HttpRefusal> {
    text.parse()
        .map_err(|_| HttpRefusal::Wrong(format!("{what}: {text:?}: expected a number")))
}

fn archive(service: &Service, index: &str) -> Result<HttpResponse, HttpRefusal> {
    let collection = service.catalogue.collection(number(index, "archive")?)?;
    let mut words = json!({
        "name": collection.name,
        "map": collection.map,
        "tasks": collection.tasks,
        "control_steps": collection.config.protocol.control_steps,
        "dataset": collection.config.data.dataset,
        "robots": collection.robots,
    });
    named(&mut words, &collection.config.class_names());
    Ok(HttpResponse::json(&words))
}

fn images(service: &Service, request: &Request) -> Result<HttpResponse, HttpRefusal> {
    let Some(set) = request.asked("set") else {
        return Ok(HttpResponse::json(&service.images.list()));
    };
    let or = |key: &str, default: usize| {
        request
            .asked(key)
            .map_or(Ok(default), |text| number(text, key))
    };
    let class = request
        .asked("class")
        .map_or(Ok(0), |text| number(text, "class"))?;
    let page = service
        .images
        .page(set, class, or("from", 0)?, or("count", 24)?)?;
    Ok(HttpResponse::json(&page))
}

fn change(service: &Service, id: &str, body: &[u8]) -> Result<HttpResponse, HttpRefusal> {
    let simulation = service.simulations.simulation(number(id, "simulation")?)?;
    let ChangeRequest {
        shown,
        speed,
        paused,
    } = request::read(body)?;
    let seen = shown
        .map(|shown| shown.seen(&simulation.who, &service.images))
        .transpose()?;
    simulation.change(speed.map(Pace::of).transpose()?, paused, seen);
    Ok(HttpResponse::done())
}
