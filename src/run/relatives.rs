//! [`Relatives`]: what robots of the same gait did, whether they entered the archive or not, for the
//! [surrogate](crate::task::surrogate) to learn from.

use crate::body::{Body, Material};
use crate::task::surrogate::Relative;
use serde::{Deserialize, Serialize};

/// Robots that lived in this period, and what they did; in the order in which they lived.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Relatives(Vec<Lived>);

/// A robot that lived.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Lived {
    body: Body,
    /// Under the training images, as far as known; nothing of the last.
    displacements: Vec<Option<f64>>,
}

impl Relatives {
    /// Adds a robot, with its displacements as far as known.
    pub fn add(&mut self, body: &Body, mut displacements: Vec<Option<f64>>) {
        displacements.truncate(displacements.iter().rposition(Option::is_some).map_or(0, |last| last + 1));
        self.0.push(Lived { body: body.clone(), displacements });
    }

    /// The last of them with the same gait as a body, but other than that, up to `most`, the latest first.
    pub fn of<'a>(&'a self, body: &Body, most: usize) -> Vec<Relative<'a>> {
        let is_relative = |lived: &&Lived| lived.body != *body && have_one_gait(&lived.body, body);
        let relative = |Lived { body, displacements }: &'a Lived| Relative { body, displacements };
        self.0.iter().rev().filter(is_relative).take(most).map(relative).collect()
    }

    /// Forgets whoever none of these bodies will ask for any more: robots of another gait, and of each gait all but the last.
    pub fn keep(&mut self, bodies: &[&Body], most: usize) {
        let mut gaits: Vec<(&Body, usize)> = Vec::new();
        for &body in bodies {
            if !gaits.iter().any(|(other, _)| have_one_gait(other, body)) {
                // One of them may be who asks.
                gaits.push((body, most + 1));
            }
        }
        let mut is_kept: Vec<bool> = (self.0.iter().rev())
            .map(|lived| {
                let gait = gaits.iter_mut().find(|(body, _)| have_one_gait(body, &lived.body));
                gait.is_some_and(|(_, left)| {
                    let is_last = *left > 0;
                    *left = left.saturating_sub(1);
                    is_last
                })
            })
            .collect();
        self.0.retain(|_| is_kept.pop().unwrap_or(false));
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// Whether bodies differ in nothing but where they have which sensors in place of soft voxels: what makes them walk is the same.
fn have_one_gait(a: &Body, b: &Body) -> bool {
    let blind = |material: &Material| if material.is_sensor() { Material::Soft } else { *material };
    let (a, b) = (a.voxels(), b.voxels());
    a.height() == b.height() && a.cells().iter().map(blind).eq(b.cells().iter().map(blind))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(text: &str) -> Body {
        text.parse().unwrap()
    }

    /// Robots of two gaits, by turns, known by their displacement.
    fn relatives() -> Relatives {
        let mut relatives = Relatives::default();
        for (number, text) in ["333/522", "333/122", "333/262", "333/162", "333/225"].into_iter().enumerate()
        {
            relatives.add(&body(text), vec![Some(number as f64), None, Some(0.5), None]);
        }
        relatives
    }

    fn numbers(relatives: &Relatives, of: &str, most: usize) -> Vec<f64> {
        let relatives = relatives.of(&body(of), most);
        relatives.iter().map(|relative| relative.displacements[0].unwrap()).collect()
    }

    #[test]
    fn relatives_differ_in_sensors_only_and_the_latest_come_first() {
        let relatives = relatives();
        assert_eq!(numbers(&relatives, "333/555", 9), [4.0, 2.0, 0.0]);
        assert_eq!(numbers(&relatives, "333/555", 2), [4.0, 2.0]);
        // Nobody is a relative of itself.
        assert_eq!(numbers(&relatives, "333/262", 9), [4.0, 0.0]);
        assert_eq!(numbers(&relatives, "333/155", 9), [3.0, 1.0]);
        assert!(numbers(&relatives, "333522", 9).is_empty());
        assert!(numbers(&relatives, "334/522", 9).is_empty() && numbers(&relatives, "333/555", 0).is_empty());
        assert_eq!(relatives.of(&body("333/555"), 1)[0].displacements, [Some(4.0), None, Some(0.5)]);
    }

    #[test]
    fn who_is_forgotten_would_not_have_been_asked_for() {
        for most in 0..5 {
            for bodies in
                [&["333/522"][..], &["333/262", "333/555"], &["333/262", "333/155"], &["444/222"], &[]]
            {
                let (all, mut kept) = (relatives(), relatives());
                let parsed: Vec<Body> = bodies.iter().map(|text| body(text)).collect();
                kept.keep(&parsed.iter().collect::<Vec<_>>(), most);
                for text in bodies {
                    assert_eq!(numbers(&kept, text, most), numbers(&all, text, most), "{bodies:?} {most}");
                }
                assert!(kept.0.len() <= bodies.len().min(2) * (most + 1));
            }
        }
    }

    #[test]
    fn files_keep_them_to_the_bit() {
        let mut relatives = relatives();
        relatives.add(&body("333/222"), vec![None, None]);
        relatives.add(&body("333/255"), vec![Some(0.1 + 0.2), Some(-1e-300)]);
        let text = serde_json::to_string(&relatives).unwrap();
        assert_eq!(serde_json::from_str::<Relatives>(&text).unwrap(), relatives);
        assert!(!relatives.is_empty() && Relatives::default().is_empty());
    }
}
