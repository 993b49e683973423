//! The six mutations of a [`Cppn`].

use crate::base::random::Stream;
use crate::genome::cppn::{Cppn, FIRST_HIDDEN, INPUTS, MAX_HIDDEN, OUTPUTS};
use crate::genome::function::Function;
use crate::genome::params::MutationParams;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mutation {
    /// Splits an edge by a hidden node with a random function: the edge's weight in, weight 1 out.
    AddNode,
    /// Removes a hidden node; joins each predecessor to each successor by the product of the two
    /// weights, unless there is an edge between them already.
    RemoveNode,
    /// Adds an edge that closes no cycle, with weight ± [`MutationParams::new_edge_weight`].
    AddEdge,
    RemoveEdge,
    /// Gives a hidden or output node another function.
    ChangeFunction,
    /// Adds a normal deviate to a weight, then clips it.
    ChangeWeight,
}

/// Pairs of nodes drawn for a new edge before giving up. The draw is uniform among possible pairs,
/// and cheap however large the network.
const EDGE_DRAWS: usize = 100;

impl Mutation {
    /// All six, each with the same probability.
    pub(crate) const ALL: [Mutation; 6] = [
        Mutation::AddNode,
        Mutation::RemoveNode,
        Mutation::AddEdge,
        Mutation::RemoveEdge,
        Mutation::ChangeFunction,
        Mutation::ChangeWeight,
    ];

    /// Mutates a network; returns false and leaves it unchanged if that is impossible.
    pub(crate) fn apply(self, cppn: &mut Cppn, params: &MutationParams, rng: &mut Stream) -> bool {
        let applied = match self {
            Mutation::AddNode => add_node(cppn, rng),
            Mutation::RemoveNode => remove_node(cppn, params, rng),
            Mutation::AddEdge => add_edge(cppn, params, rng),
            Mutation::RemoveEdge => draw_edge(cppn, rng).map(|edge| {
                cppn.disconnect(edge);
            }),
            Mutation::ChangeFunction => change_function(cppn, rng),
            Mutation::ChangeWeight => change_weight(cppn, params, rng),
        };
        if applied.is_some() {
            cppn.prune();
        }
        applied.is_some()
    }
}

/// Applies one random mutation; an impossible one (nothing to remove …) is drawn again.
pub(crate) fn mutate(cppn: &mut Cppn, params: &MutationParams, rng: &mut Stream) -> Mutation {
    loop {
        // The loop ends: a function can always be changed.
        let mutation = Mutation::ALL[rng.below(Mutation::ALL.len())];
        if mutation.apply(cppn, params, rng) {
            return mutation;
        }
    }
}

fn draw_edge(cppn: &Cppn, rng: &mut Stream) -> Option<usize> {
    (!cppn.edges().is_empty()).then(|| rng.below(cppn.edges().len()))
}

fn add_node(cppn: &mut Cppn, rng: &mut Stream) -> Option<()> {
    if cppn.hidden().len() == MAX_HIDDEN {
        return None;
    }
    let split = draw_edge(cppn, rng)?;
    let edge = cppn.disconnect(split);
    let node = cppn.add_hidden(*rng.choose(Function::for_hidden())?);
    cppn.connect(edge.from, node, edge.weight);
    cppn.connect(node, edge.to, 1.0);
    Some(())
}

fn remove_node(cppn: &mut Cppn, params: &MutationParams, rng: &mut Stream) -> Option<()> {
    let count = cppn.hidden().len();
    let node = FIRST_HIDDEN + (count > 0).then(|| rng.below(count))?;
    let into = cppn.incoming(node).to_vec();
    let out: Vec<_> = cppn
        .edges()
        .iter()
        .copied()
        .filter(|e| e.from == node)
        .collect();
    for i in &into {
        for o in &out {
            // Products of weights within 1 stay within it; others must not grow without bound.
            cppn.connect(i.from, o.to, clip(i.weight * o.weight, params));
        }
    }
    cppn.retain_hidden(|n| n != node);
    Some(())
}

fn add_edge(cppn: &mut Cppn, params: &MutationParams, rng: &mut Stream) -> Option<()> {
    let hidden = cppn.hidden().len();
    for _ in 0..EDGE_DRAWS {
        // From an input or hidden node (outputs lie between them) to an output or hidden node.
        let from = rng.below(INPUTS + hidden);
        let from = if from < INPUTS { from } else { from + OUTPUTS };
        let to = INPUTS + rng.below(OUTPUTS + hidden);
        if cppn.may_connect(from, to) {
            let sign = [1.0, -1.0][rng.below(2)];
            cppn.connect(from, to, sign * params.new_edge_weight);
            return Some(());
        }
    }
    None
}

fn change_function(cppn: &mut Cppn, rng: &mut Stream) -> Option<()> {
    let node = INPUTS + rng.below(OUTPUTS + cppn.hidden().len());
    let legal = if node < FIRST_HIDDEN {
        &Function::ALL
    } else {
        Function::for_hidden()
    };
    let now = cppn.function(node)?;
    let others: Vec<Function> = legal.iter().copied().filter(|f| *f != now).collect();
    cppn.set_function(node, *rng.choose(&others)?);
    Some(())
}

fn change_weight(cppn: &mut Cppn, params: &MutationParams, rng: &mut Stream) -> Option<()> {
    let edge = draw_edge(cppn, rng)?;
    let weight = cppn.edges()[edge].weight + params.weight_sigma * rng.normal();
    cppn.set_weight(edge, clip(weight, params));
    Some(())
}

fn clip(weight: f64, params: &MutationParams) -> f64 {
    weight.clamp(-params.weight_limit, params.weight_limit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::{Purpose, stream};
    use proptest::prelude::*;

    fn rng(seed: u64) -> Stream {
        stream(seed, Purpose::Mutation, 0, 0)
    }

    fn apply(mutation: Mutation, cppn: &Cppn, seed: u64) -> Option<Cppn> {
        let mut mutant = cppn.clone();
        mutation
            .apply(&mut mutant, &MutationParams::default(), &mut rng(seed))
            .then_some(mutant)
    }

    fn edges(cppn: &Cppn) -> Vec<(usize, usize, f64)> {
        cppn.edges().iter().map(|e| (*e).into()).collect()
    }

    /// Makes x and y → 11 → outputs 4 and 5, and y → 5 beside it.
    fn diamond() -> Cppn {
        let mut cppn = Cppn::initial();
        (0..28).rev().for_each(|e| {
            cppn.disconnect(e);
        });
        let node = cppn.add_hidden(Function::Sin);
        [
            (0, node, 0.5),
            (1, node, -0.4),
            (node, 4, 0.2),
            (node, 5, 1.0),
            (1, 5, 0.9),
        ]
        .iter()
        .for_each(|&(from, to, weight)| cppn.connect(from, to, weight));
        cppn
    }

    #[test]
    fn adding_a_node_splits_an_edge() {
        let mut start = Cppn::initial();
        (0..28).for_each(|e| start.set_weight(e, 0.01 * e as f64));
        let mutant = apply(Mutation::AddNode, &start, 1).unwrap();
        assert_eq!((mutant.edges().len(), mutant.hidden().len()), (29, 1));
        let out = mutant
            .edges()
            .iter()
            .find(|e| e.from == FIRST_HIDDEN)
            .unwrap();
        let into = mutant.incoming(FIRST_HIDDEN)[0];
        let split = start
            .edges()
            .iter()
            .find(|e| (e.from, e.to) == (into.from, out.to))
            .unwrap();
        assert_eq!((into.weight, out.weight), (split.weight, 1.0));
        assert!(mutant.may_connect(into.from, out.to));
    }

    #[test]
    fn removing_a_node_joins_its_edges_where_there_is_none() {
        let mutant = apply(Mutation::RemoveNode, &diamond(), 1).unwrap();
        // 1 → 5 was there and keeps its weight.
        assert_eq!(
            edges(&mutant),
            [(0, 4, 0.1), (1, 4, -0.4 * 0.2), (0, 5, 0.5), (1, 5, 0.9)]
        );
        assert!(mutant.hidden().is_empty());
    }

    #[test]
    fn added_edges_are_new_and_weigh_a_tenth() {
        let signs: Vec<f64> = (0..20)
            .map(|seed| {
                let mutant = apply(Mutation::AddEdge, &diamond(), seed).unwrap();
                assert_eq!(mutant.edges().len(), 6);
                let new = mutant
                    .edges()
                    .iter()
                    .find(|e| !diamond().edges().contains(e))
                    .unwrap();
                new.weight
            })
            .collect();
        assert!(
            signs.contains(&0.1) && signs.contains(&-0.1) && signs.iter().all(|w| w.abs() == 0.1)
        );
    }

    #[test]
    fn removing_an_edge_prunes_what_dangles() {
        for seed in 0..20 {
            let mutant = apply(Mutation::RemoveEdge, &diamond(), seed).unwrap();
            assert_eq!((mutant.edges().len(), mutant.hidden().len()), (4, 1));
        }
        let mut line = diamond();
        while line.edges().len() > 2 {
            line.disconnect(
                line.edges()
                    .iter()
                    .position(|e| e.to == 5 || e.from == 1)
                    .unwrap(),
            );
        }
        let mutant = apply(Mutation::RemoveEdge, &line, 0).unwrap();
        assert!(mutant.hidden().is_empty() && mutant.edges().is_empty());
    }

    #[test]
    fn a_changed_function_is_another_and_outputs_may_squash_again() {
        let mut cppn = diamond();
        cppn.set_function(4, Function::Abs);
        let (mut squashed, mut hidden_changed) = (false, false);
        for seed in 0..400 {
            let mutant = apply(Mutation::ChangeFunction, &cppn, seed).unwrap();
            let changed: Vec<usize> = (4..12)
                .filter(|n| mutant.function(*n) != cppn.function(*n))
                .collect();
            assert_eq!(changed.len(), 1);
            squashed |= mutant.function(4) == Some(Function::Squash);
            hidden_changed |= changed == [11];
            assert_ne!(mutant.function(11), Some(Function::Squash));
        }
        assert!(squashed && hidden_changed);
    }

    #[test]
    fn changed_weights_are_normal_around_the_old_and_clipped() {
        let change = |seed| {
            let mutant = apply(Mutation::ChangeWeight, &Cppn::initial(), seed).unwrap();
            let changed: Vec<f64> = mutant
                .edges()
                .iter()
                .map(|e| e.weight)
                .filter(|w| *w != 0.0)
                .collect();
            assert_eq!(changed.len(), 1);
            changed[0]
        };
        let weights: Vec<f64> = (0..4000).map(change).collect();
        let within = |size| weights.iter().filter(|w| w.abs() <= size).count() as f64 / 4000.0;
        assert!((within(0.5) - 0.683).abs() < 0.03, "{}", within(0.5));
        assert!(within(1.0) == 1.0 && weights.contains(&1.0) && weights.contains(&-1.0));
    }

    #[test]
    fn impossible_mutations_leave_the_network_as_it_is() {
        let initial = Cppn::initial();
        assert_eq!(apply(Mutation::RemoveNode, &initial, 0), None);
        assert_eq!(apply(Mutation::AddEdge, &initial, 0), None);
        let mut bare = initial;
        (0..28).rev().for_each(|e| {
            bare.disconnect(e);
        });
        for mutation in [
            Mutation::AddNode,
            Mutation::RemoveEdge,
            Mutation::ChangeWeight,
        ] {
            assert_eq!(apply(mutation, &bare, 0), None);
        }
    }

    #[test]
    fn the_six_are_drawn_with_equal_probability() {
        let mut counts = [0; 6];
        for seed in 0..6000 {
            let drawn = mutate(&mut diamond(), &MutationParams::default(), &mut rng(seed));
            counts[Mutation::ALL.iter().position(|m| *m == drawn).unwrap()] += 1;
        }
        assert!(counts.iter().all(|c| (880..1120).contains(c)), "{counts:?}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn mutants_are_networks_a_file_can_hold(seed: u64, steps in 1..200usize) {
            let (mut cppn, mut rng) = (Cppn::initial(), rng(seed));
            for _ in 0..steps {
                mutate(&mut cppn, &MutationParams::default(), &mut rng);
                prop_assert!(cppn.edges().iter().all(|e| e.weight.abs() <= 1.0));
                let mut pruned = cppn.clone();
                pruned.prune();
                prop_assert_eq!(&pruned, &cppn);
            }
            let text = serde_json::to_string(&cppn).unwrap();
            prop_assert_eq!(serde_json::from_str::<Cppn>(&text).unwrap(), cppn);
        }
    }
}
