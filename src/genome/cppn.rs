//! [`Cppn`]: a compositional pattern-producing network, as a graph that is always acyclic.

use crate::body::Material;
use crate::genome::file::{CppnFile, VERSION};
use crate::genome::function::Function;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Number of inputs: nodes 0 (x), 1 (y), 2 (distance to the centre) and 3 (bias).
pub(crate) const INPUTS: usize = 4;
/// Number of outputs, one per material in the order of [`Material::ALL`]: nodes 4 … 10.
pub(crate) const OUTPUTS: usize = Material::ALL.len();
/// Number of the first hidden node.
pub(crate) const FIRST_HIDDEN: usize = INPUTS + OUTPUTS;
/// Most hidden nodes of a network (under mutation alone some 20 at most).
pub(crate) const MAX_HIDDEN: usize = 1000;

/// A weighted connection; in files `[from, to, weight]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "(usize, usize, f64)", into = "(usize, usize, f64)")]
pub(crate) struct Edge {
    /// Source node: an input or a hidden node.
    pub(crate) from: usize,
    /// Target node: an output or a hidden node.
    pub(crate) to: usize,
    /// Weight, finite.
    pub(crate) weight: f64,
}

/// A compositional pattern-producing network (Stanley 2007; paper, section "Genome").
///
/// Nodes are numbered 0–3 inputs (x, y, distance, bias), 4–10 outputs (materials 0–6), 11… hidden,
/// without gaps. In files:
///
/// ```json
/// {"version": 1, "outputs": ["squash", …7], "hidden": ["sin", …], "edges": [[from, to, weight], …]}
/// ```
///
/// `outputs` and `hidden` are the nodes' functions in the order of their numbers (squash is for
/// outputs only). Edges lead from inputs and hidden nodes to outputs and hidden nodes, no two join
/// the same nodes, and they form no cycle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "CppnFile", into = "CppnFile")]
pub(crate) struct Cppn {
    pub(super) outputs: [Function; OUTPUTS],
    pub(super) hidden: Vec<Function>,
    /// Sorted by (to, from): a node's incoming edges are one run, summed in this order.
    pub(super) edges: Vec<Edge>,
}

impl Cppn {
    /// Returns the start of evolution: inputs fully connected to squashing outputs with weights 0.
    pub(crate) fn initial() -> Self {
        let pairs = (INPUTS..FIRST_HIDDEN).flat_map(|to| (0..INPUTS).map(move |from| (from, to)));
        let edges = pairs
            .map(|(from, to)| Edge {
                from,
                to,
                weight: 0.0,
            })
            .collect();
        Cppn {
            outputs: [Function::Squash; OUTPUTS],
            hidden: Vec::new(),
            edges,
        }
    }

    /// Returns the number of nodes: inputs, outputs and hidden.
    pub(crate) fn node_count(&self) -> usize {
        FIRST_HIDDEN + self.hidden.len()
    }

    /// Returns the functions of the hidden nodes 11, 12, ….
    pub(crate) fn hidden(&self) -> &[Function] {
        &self.hidden
    }

    /// Returns all edges, sorted by target, then by source.
    pub(crate) fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Returns the edges into a node, sorted by source.
    pub(crate) fn incoming(&self, node: usize) -> &[Edge] {
        let start = self.edges.partition_point(|e| e.to < node);
        let count = self.edges[start..].partition_point(|e| e.to == node);
        &self.edges[start..start + count]
    }

    /// Returns the function of an output or hidden node; `None` for inputs and unused numbers.
    pub(crate) fn function(&self, node: usize) -> Option<Function> {
        let (outputs, hidden) = (node.checked_sub(INPUTS)?, node.checked_sub(FIRST_HIDDEN));
        self.outputs
            .get(outputs)
            .or_else(|| self.hidden.get(hidden?))
            .copied()
    }

    pub(crate) fn topological_order(&self) -> Vec<usize> {
        // Kahn's algorithm; nodes on a cycle are never reached.
        let mut waiting_for = vec![0; self.node_count()];
        let mut successors = vec![Vec::new(); self.node_count()];
        for e in &self.edges {
            waiting_for[e.to] += 1;
            successors[e.from].push(e.to);
        }
        let mut order: Vec<usize> = (0..self.node_count())
            .filter(|&n| waiting_for[n] == 0)
            .collect();
        let mut done = 0;
        while done < order.len() {
            for &next in &successors[order[done]] {
                waiting_for[next] -= 1;
                if waiting_for[next] == 0 {
                    order.push(next);
                }
            }
            done += 1;
        }
        order
    }

    /// Returns the content in bytes, equal for equal networks and only for them: numbers
    /// little-endian, weights as bits. Ids are made of it, so it must not change within a version.
    pub(crate) fn canonical_bytes(&self) -> Vec<u8> {
        let mut bytes = VERSION.to_le_bytes().to_vec();
        bytes.extend(self.outputs.iter().map(|f| *f as u8));
        bytes.extend((self.hidden.len() as u64).to_le_bytes());
        bytes.extend(self.hidden.iter().map(|f| *f as u8));
        for e in &self.edges {
            bytes.extend((e.from as u64).to_le_bytes());
            bytes.extend((e.to as u64).to_le_bytes());
            bytes.extend(e.weight.to_bits().to_le_bytes());
        }
        bytes
    }

    /// Returns true if two nodes may get an edge: there is none, and it closes no cycle.
    pub(super) fn may_connect(&self, from: usize, to: usize) -> bool {
        self.position(from, to).is_err() && !self.is_ancestor(to, from)
    }

    /// Adds an edge unless there is one.
    pub(super) fn connect(&mut self, from: usize, to: usize, weight: f64) {
        if let Err(at) = self.position(from, to) {
            self.edges.insert(at, Edge { from, to, weight });
        }
    }

    pub(super) fn disconnect(&mut self, edge: usize) -> Edge {
        self.edges.remove(edge)
    }

    pub(super) fn set_weight(&mut self, edge: usize, weight: f64) {
        self.edges[edge].weight = weight;
    }

    pub(super) fn set_function(&mut self, node: usize, function: Function) {
        if node < FIRST_HIDDEN {
            self.outputs[node - INPUTS] = function;
        } else {
            self.hidden[node - FIRST_HIDDEN] = function;
        }
    }

    pub(super) fn add_hidden(&mut self, function: Function) -> usize {
        self.hidden.push(function);
        self.node_count() - 1
    }

    /// Removes hidden nodes that no input reaches, or that reach no output.
    pub(super) fn prune(&mut self) {
        let order = self.topological_order();
        let mut fed: Vec<bool> = (0..self.node_count()).map(|n| n < INPUTS).collect();
        for &node in order.iter().filter(|n| **n >= INPUTS) {
            fed[node] = self.incoming(node).iter().any(|e| fed[e.from]);
        }
        let mut useful: Vec<bool> = (0..self.node_count()).map(|n| n < FIRST_HIDDEN).collect();
        for &node in order.iter().rev() {
            if useful[node] {
                self.incoming(node)
                    .iter()
                    .for_each(|e| useful[e.from] = true);
            }
        }
        self.retain_hidden(|node| fed[node] && useful[node]);
    }

    /// Removes hidden nodes that `keep` rejects, with their edges; later ones move up in number.
    pub(super) fn retain_hidden(&mut self, keep: impl Fn(usize) -> bool) {
        let kept = |node: usize| node < FIRST_HIDDEN || keep(node);
        let mut next = 0..;
        let renamed: Vec<Option<usize>> = (0..self.node_count())
            .map(|node| if kept(node) { next.next() } else { None })
            .collect();
        let hidden = std::mem::take(&mut self.hidden);
        let numbered = hidden.into_iter().zip(FIRST_HIDDEN..);
        self.hidden = numbered
            .filter(|(_, node)| kept(*node))
            .map(|(f, _)| f)
            .collect();
        // The new numbers keep the old order: the edges stay sorted.
        let edges = std::mem::take(&mut self.edges);
        let rename = |e: Edge| {
            Some(Edge {
                from: renamed[e.from]?,
                to: renamed[e.to]?,
                ..e
            })
        };
        self.edges = edges.into_iter().filter_map(rename).collect();
    }

    fn position(&self, from: usize, to: usize) -> Result<usize, usize> {
        self.edges
            .binary_search_by_key(&(to, from), |e| (e.to, e.from))
    }

    /// Returns true if `node` is `of` or one of its direct or indirect predecessors.
    fn is_ancestor(&self, node: usize, of: usize) -> bool {
        let mut seen = vec![false; self.node_count()];
        let mut open = vec![of];
        while let Some(n) = open.pop() {
            if n == node {
                return true;
            }
            if !std::mem::replace(&mut seen[n], true) {
                open.extend(self.incoming(n).iter().map(|e| e.from));
            }
        }
        false
    }
}

impl From<(usize, usize, f64)> for Edge {
    fn from((from, to, weight): (usize, usize, f64)) -> Self {
        Edge { from, to, weight }
    }
}

impl From<Edge> for (usize, usize, f64) {
    fn from(edge: Edge) -> Self {
        (edge.from, edge.to, edge.weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes x → 11 (|s|) → 12 (s²) → first output.
    fn chain() -> Cppn {
        let mut cppn = Cppn::initial();
        cppn.edges.clear();
        cppn.hidden = vec![Function::Abs, Function::Square];
        cppn.connect(0, 11, 0.5);
        cppn.connect(11, 12, 1.0);
        cppn.connect(12, 4, -1.0);
        cppn
    }

    #[test]
    fn evolution_starts_fully_connected_with_weights_0() {
        let cppn = Cppn::initial();
        assert_eq!((cppn.edges().len(), cppn.hidden().len()), (28, 0));
        assert!(
            cppn.edges()
                .iter()
                .all(|e| e.weight == 0.0 && e.from < 4 && (4..11).contains(&e.to))
        );
        assert!((4..11).all(|n| cppn.function(n) == Some(Function::Squash)));
        assert_eq!((cppn.function(3), cppn.function(11)), (None, None));
    }

    #[test]
    fn every_node_comes_after_its_predecessors() {
        let cppn = chain();
        let order = cppn.topological_order();
        let place = |node| order.iter().position(|n| *n == node).unwrap();
        assert_eq!(order.len(), 13);
        assert!(place(0) < place(11) && place(11) < place(12) && place(12) < place(4));
    }

    #[test]
    fn edges_that_close_a_cycle_or_exist_may_not_be_added() {
        let cppn = chain();
        assert!(!cppn.may_connect(12, 11) && !cppn.may_connect(11, 11));
        assert!(!cppn.may_connect(11, 12));
        assert!(cppn.may_connect(0, 12) && cppn.may_connect(11, 4));
    }

    #[test]
    fn pruning_removes_what_no_input_reaches_or_reaches_no_output() {
        let mut cppn = chain();
        cppn.prune();
        assert_eq!(cppn, chain());
        // Without its last edge the whole chain is useless.
        let mut open = chain();
        open.disconnect(0);
        open.prune();
        assert!(open.hidden().is_empty() && open.edges().is_empty());
        // A node that only useless nodes feed goes with them; the others move up in number.
        let mut unfed = chain();
        let node = unfed.add_hidden(Function::Sin);
        unfed.connect(1, node, 0.3);
        unfed.connect(node, 5, 0.7);
        unfed.disconnect(unfed.edges.iter().position(|e| e.to == 11).unwrap());
        unfed.prune();
        assert_eq!(unfed.hidden(), [Function::Sin]);
        let edges: Vec<_> = unfed
            .edges()
            .iter()
            .map(|e| (e.from, e.to, e.weight))
            .collect();
        assert_eq!(edges, [(11, 5, 0.7), (1, 11, 0.3)]);
    }

    #[test]
    fn content_in_bytes_tells_networks_apart() {
        let mut other = chain();
        other.set_weight(0, -1.0 + f64::EPSILON);
        assert_eq!(chain().canonical_bytes(), chain().canonical_bytes());
        assert_ne!(chain().canonical_bytes(), other.canonical_bytes());
        other = chain();
        other.set_function(12, Function::Sqrt);
        assert_ne!(chain().canonical_bytes(), other.canonical_bytes());
    }
}
