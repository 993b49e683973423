//! The claims of `morphcog verify`, and how they compare with what was measured.

use crate::base::text::{counted, duration};
use crate::cli::output::console::{Console, Mode};
use crate::commands::verify::{Agreement, Claim, Verified, VerifyOptions, minutes};

/// Lists claims with their commands and costs.
pub(crate) fn list(console: &Console, claims: &[Claim]) {
    if console.mode() == Mode::Json {
        return claims
            .iter()
            .for_each(|claim| console.event("claim", &serde_json::json!({ "claim": claim })));
    }
    for claim in claims {
        console.line(&format!("{}: {}", claim.name, claim.claim));
        for command in claim.typed() {
            console.command(&format!("  {command}"));
        }
        let needs = match claim.needed() {
            needs if needs.is_empty() => String::new(),
            needs => format!("; needs {needs}"),
        };
        let cost = format!(
            "{} CPU minutes on {}{needs}",
            minutes(claim.cpu_minutes),
            claim.processor
        );
        console.line(&format!("  {}; {cost}", claim.expected()));
        console.line("");
    }
}

/// Says what the chosen claims cost.
pub(crate) fn costs(console: &Console, options: &VerifyOptions) {
    let total: f64 = options.claims.iter().map(|claim| claim.cpu_minutes).sum();
    console.info(&format!(
        "{}: about {} of processor time; results in {}",
        counted(options.claims.len(), "claim", "claims"),
        duration(60.0 * total),
        options.out.display()
    ));
}

/// Writes a line for every value of every claim, and how many claims hold.
pub(crate) fn verified(console: &Console, all: &[Verified]) {
    if console.mode() == Mode::Json {
        return all
            .iter()
            .for_each(|verified| console.event("verified", verified));
    }
    if all.is_empty() {
        return;
    }
    let mut rows = Vec::new();
    for verified in all {
        let values = verified.claim.values.iter().zip(&verified.measured);
        for (index, (claimed, measured)) in values.enumerate() {
            rows.push(vec![
                if index == 0 {
                    verified.claim.name.clone()
                } else {
                    String::new()
                },
                claimed.label.clone(),
                claimed.claimed(),
                measured.map_or("–".to_string(), |value| claimed.shown(value)),
                verified.agreements[index].words().to_string(),
            ]);
        }
    }
    console.table(&["claim", "value", "claimed", "measured", ""], &rows);
    console.line("");
    for (name, error) in all
        .iter()
        .filter_map(|one| Some((&one.claim.name, one.error.as_ref()?)))
    {
        console.line(&format!("{name}: {error}"));
    }
    let count = |agreement| {
        all.iter()
            .filter(|one| one.agreement() == agreement)
            .count()
    };
    let counts = [
        Agreement::Reproduced,
        Agreement::WithinTolerance,
        Agreement::NotReproduced,
    ];
    let counts: Vec<String> = counts
        .iter()
        .filter(|agreement| count(**agreement) > 0)
        .map(|agreement| format!("{} {}", count(*agreement), agreement.words()))
        .collect();
    console.line(&format!(
        "{}: {}",
        counted(all.len(), "claim", "claims"),
        counts.join(", ")
    ));
}
