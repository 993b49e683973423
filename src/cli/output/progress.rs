//! Progress in words: counts, remaining time, speed.

use crate::base::number;
use crate::base::observer::Generation;
use crate::base::text::duration;

/// Seconds after which the speed is measured anew, and how much must be done by then.
const ANEW: (f64, u64) = (60.0, 10);

/// A state of one or two minutes ago, or of the beginning. Speed and remaining time are measured
/// from there, because work progresses unevenly and may have been suspended.
#[derive(Clone, Copy, Debug)]
pub struct Recent<T> {
    marks: [(f64, T); 2],
}

impl<T: Copy> Recent<T> {
    /// Begins after so many seconds.
    pub fn new(seconds: f64, begin: T) -> Self {
        Recent {
            marks: [(seconds, begin); 2],
        }
    }

    /// Changes the earlier state, so that something counts as done before.
    pub(crate) fn shift(&mut self, change: impl Fn(&mut T)) {
        self.marks.iter_mut().for_each(|(_, mark)| change(mark));
    }

    /// Returns the seconds since the earlier state, and that state; `done` counts completed items.
    pub fn since(&mut self, seconds: f64, now: T, done: impl Fn(&T) -> u64) -> (f64, T) {
        let [_, (then, mark)] = self.marks;
        if seconds - then >= ANEW.0 && done(&now).saturating_sub(done(&mark)) >= ANEW.1 {
            self.marks = [(then, mark), (seconds, now)];
        }
        let [(then, mark), _] = self.marks;
        (seconds - then, mark)
    }
}

/// A progress message: a label, and parts in order of importance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgressWords {
    /// The activity.
    pub label: String,
    /// The count, the remaining time, and so on.
    pub parts: Vec<String>,
}

/// Describes the progress of an evolution, given its state some seconds ago.
pub fn generation_line(now: &Generation, before: &Generation, seconds: f64) -> ProgressWords {
    let best = now
        .best
        .map_or("none".into(), |best| number::fixed(best, 2));
    let rate = rate(now.evaluations.saturating_sub(before.evaluations), seconds);
    let mut parts = vec![format!("{}/{}", now.done, now.total)];
    parts.extend(left(before.done, now.done, now.total, seconds));
    parts.push(format!("best {best}"));
    parts.push(format!("coverage {} %", number::percent(now.coverage)));
    parts.push(format!("{rate} evaluations/s"));
    ProgressWords {
        label: "generation".to_string(),
        parts,
    }
}

/// Describes the progress of something counted: images, robots or, with the unit "bytes",
/// megabytes. `before` of them were done some seconds ago.
pub fn count_line(
    label: &str,
    [before, done, total]: [u64; 3],
    unit: &str,
    seconds: f64,
) -> ProgressWords {
    let did = done.saturating_sub(before);
    let (counts, speed) = if unit == "bytes" {
        let mega = |bytes: f64| number::fixed(bytes / 1e6, 1);
        let speed = if seconds > 0.0 {
            did as f64 / seconds
        } else {
            0.0
        };
        let [done, total, speed] = [done as f64, total as f64, speed].map(mega);
        (format!("{done}/{total} MB"), format!("{speed} MB/s"))
    } else {
        (
            format!("{done}/{total} {unit}"),
            format!("{} {unit}/s", rate(did, seconds)),
        )
    };
    let mut parts = vec![counts];
    parts.extend(left(before, done, total, seconds));
    parts.push(speed);
    ProgressWords {
        label: label.to_string(),
        parts,
    }
}

fn rate(count: u64, seconds: f64) -> String {
    let rate = if seconds > 0.0 {
        count as f64 / seconds
    } else {
        0.0
    };
    number::fixed(rate, if rate < 10.0 { 1 } else { 0 })
}

fn left(before: u64, done: u64, total: u64, seconds: f64) -> Option<String> {
    let (did, todo) = (done.saturating_sub(before), total.saturating_sub(done));
    (did > 0 && todo > 0).then(|| format!("{} left", duration(seconds * todo as f64 / did as f64)))
}

/// Decides when a plain line is due where lines cannot be rewritten: the first at once, then every
/// ten seconds or every tenth of the work, and the last.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pacer(Option<(f64, f64)>);

impl Pacer {
    /// Returns true if a line is due, given the seconds since the start and the share of work done.
    pub(crate) fn is_due(&mut self, seconds: f64, share: f64) -> bool {
        let due = match self.0 {
            None => true,
            Some((then, before)) => {
                seconds - then >= 10.0 || share - before >= 0.1 || (share >= 1.0 && before < 1.0)
            }
        };
        if due {
            self.0 = Some((seconds, share));
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(line: ProgressWords) -> String {
        format!("{}: {}", line.label, line.parts.join(", "))
    }

    #[test]
    fn a_resumed_run_counts_its_speed_from_where_it_resumed() {
        let begin = Generation {
            done: 100,
            total: 200,
            best: None,
            coverage: 0.0,
            evaluations: 2000,
            qd_score: 0.0,
        };
        let now = Generation {
            done: 150,
            best: Some(3.1449),
            coverage: 0.25,
            evaluations: 3000,
            ..begin
        };
        let line = text(generation_line(&now, &begin, 10.0));
        assert_eq!(
            line,
            "generation: 150/200, 10 s left, best 3.14, coverage 25.0 %, 100 evaluations/s"
        );
        let line = text(generation_line(&begin, &begin, 0.0));
        assert!(
            line.ends_with("100/200, best none, coverage 0.0 %, 0.0 evaluations/s"),
            "{line}"
        );
    }

    #[test]
    fn counted_things_have_their_unit() {
        let line = |label: &str, counts: [u64; 3], unit: &str, seconds: f64| {
            text(count_line(label, counts, unit, seconds))
        };
        assert_eq!(
            line("eval", [0, 50, 100], "images", 5.0),
            "eval: 50/100 images, 5 s left, 10 images/s"
        );
        let bytes = line("train images", [0, 5_000_000, 10_000_000], "bytes", 2.0);
        assert_eq!(bytes, "train images: 5.0/10.0 MB, 2 s left, 2.5 MB/s");
        assert!(line("x", [0, 3, 0], "images", 0.0).contains("3/0"));
        // Work known before took no time.
        assert_eq!(
            line("x", [40, 40, 50], "rollouts", 1e-9),
            "x: 40/50 rollouts, 0.0 rollouts/s"
        );
        assert_eq!(
            line("x", [40, 45, 50], "rollouts", 5.0),
            "x: 45/50 rollouts, 5 s left, 1.0 rollouts/s"
        );
    }

    #[test]
    fn speed_is_that_of_the_last_minutes() {
        let mut recent = Recent::new(5.0, 40);
        let mut since = |seconds: f64, done: u64| recent.since(seconds, done, |done| *done);
        assert_eq!(since(15.0, 60), (10.0, 40));
        assert_eq!(since(65.0, 100), (60.0, 40));
        // An hour's pause counts for two minutes of work.
        assert_eq!(since(3665.0, 101), (3660.0, 40));
        assert_eq!(since(3670.0, 111), (3605.0, 100));
        assert_eq!(since(3700.0, 161), (3635.0, 100));
        assert_eq!(since(3730.0, 211), (60.0, 111));
        // Slow work is measured over as long as it takes.
        assert_eq!(since(7000.0, 215), (3330.0, 111));
    }

    #[test]
    fn what_was_skipped_counts_as_done_before() {
        let mut recent = Recent::new(0.0, 0);
        recent.shift(|done| *done += 980);
        assert_eq!(recent.since(2.0, 1000, |done| *done), (2.0, 980));
    }

    #[test]
    fn plain_lines_come_every_ten_seconds_or_tenth_and_at_the_end() {
        let mut pacer = Pacer::default();
        let due: Vec<bool> = [
            (0.0, 0.0),
            (1.0, 0.05),
            (2.0, 0.1),
            (3.0, 0.15),
            (12.0, 0.16),
            (12.5, 0.17),
            (13.0, 1.0),
        ]
        .map(|(seconds, share)| pacer.is_due(seconds, share))
        .to_vec();
        assert_eq!(due, [true, false, true, false, true, false, true]);
        assert!(!pacer.is_due(14.0, 1.0));
    }
}
