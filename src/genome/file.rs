//! The file form of a [`Cppn`] and its validation.

use crate::genome::cppn::{Cppn, Edge, FIRST_HIDDEN, INPUTS, MAX_HIDDEN, OUTPUTS};
use crate::genome::function::Function;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(super) const VERSION: u32 = 1;

#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CppnFile {
    /// Version of this form, 1.
    version: u32,
    /// Functions of the nodes 4 to 10, one for each material in the order of their numbers.
    outputs: Vec<Function>,
    /// Functions of the hidden nodes, from 11 on.
    hidden: Vec<Function>,
    /// Edges, each `[from, to, weight]`, sorted by target node.
    edges: Vec<Edge>,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum CppnError {
    #[error(
        "version {0} of the CPPN form is unknown; expected {VERSION} (made by a newer morphcog?)"
    )]
    Version(u32),
    #[error("outputs: {0} functions, expected {OUTPUTS}, one per material")]
    Outputs(usize),
    #[error("hidden: {0} nodes, at most {MAX_HIDDEN} are possible")]
    TooLarge(usize),
    #[error("hidden[{0}]: squash is for outputs only")]
    HiddenSquash(usize),
    #[error(
        "edge {from} → {to}: expected an edge from an input (0–3) or hidden node to an output (4–10) or \
         hidden node; hidden nodes are {FIRST_HIDDEN} … below {nodes}"
    )]
    Ends {
        from: usize,
        to: usize,
        nodes: usize,
    },
    #[error("edge {0} → {1} is there twice")]
    Duplicate(usize, usize),
    #[error("edge {0} → {1}: the weight must be a finite number")]
    Weight(usize, usize),
    #[error("the edges form a cycle; a CPPN must be acyclic")]
    Cycle,
}

impl TryFrom<CppnFile> for Cppn {
    type Error = CppnError;
    fn try_from(file: CppnFile) -> Result<Self, CppnError> {
        if file.version != VERSION {
            return Err(CppnError::Version(file.version));
        }
        let outputs: [Function; OUTPUTS] = file
            .outputs
            .try_into()
            .map_err(|found: Vec<_>| CppnError::Outputs(found.len()))?;
        if file.hidden.len() > MAX_HIDDEN {
            return Err(CppnError::TooLarge(file.hidden.len()));
        }
        if let Some(at) = file.hidden.iter().position(|f| *f == Function::Squash) {
            return Err(CppnError::HiddenSquash(at));
        }
        let mut cppn = Cppn {
            outputs,
            hidden: file.hidden,
            edges: file.edges,
        };
        let nodes = cppn.node_count();
        cppn.edges.sort_by_key(|e| (e.to, e.from));
        for &Edge { from, to, weight } in &cppn.edges {
            if from >= nodes || to >= nodes || (INPUTS..FIRST_HIDDEN).contains(&from) || to < INPUTS
            {
                return Err(CppnError::Ends { from, to, nodes });
            }
            if !weight.is_finite() {
                return Err(CppnError::Weight(from, to));
            }
        }
        if let Some(pair) = cppn
            .edges
            .windows(2)
            .find(|p| (p[0].from, p[0].to) == (p[1].from, p[1].to))
        {
            return Err(CppnError::Duplicate(pair[0].from, pair[0].to));
        }
        if cppn.topological_order().len() < nodes {
            return Err(CppnError::Cycle);
        }
        Ok(cppn)
    }
}

impl From<Cppn> for CppnFile {
    fn from(cppn: Cppn) -> Self {
        let Cppn {
            outputs,
            hidden,
            edges,
        } = cppn;
        CppnFile {
            version: VERSION,
            outputs: outputs.to_vec(),
            hidden,
            edges,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(hidden: &str, edges: &str) -> Result<Cppn, String> {
        let outputs = ["\"squash\""; OUTPUTS].join(",");
        let text = format!(
            r#"{{"version":1,"outputs":[{outputs}],"hidden":[{hidden}],"edges":[{edges}]}}"#
        );
        serde_json::from_str(&text).map_err(|e| e.to_string())
    }

    #[test]
    fn the_file_form_goes_there_and_back() {
        let initial = Cppn::initial();
        let text = serde_json::to_string(&initial).unwrap();
        assert!(
            text.starts_with(r#"{"version":1,"outputs":["squash","#),
            "{text}"
        );
        assert_eq!(serde_json::from_str::<Cppn>(&text).unwrap(), initial);
        let cppn = read(r#""sin","neg_sqrt""#, "[12,4,-0.25],[0,11,0.1],[11,12,1.0]").unwrap();
        let text = serde_json::to_string(&cppn).unwrap();
        assert_eq!(serde_json::from_str::<Cppn>(&text).unwrap(), cppn);
        // Edges are sorted, whatever their order in the file: the same network has the same bytes.
        let shuffled = read(r#""sin","neg_sqrt""#, "[0,11,0.1],[11,12,1.0],[12,4,-0.25]").unwrap();
        assert_eq!(shuffled.canonical_bytes(), cppn.canonical_bytes());
    }

    #[test]
    fn what_is_not_a_cppn_is_refused_with_its_place() {
        let refused = |hidden: &str, edges: &str, word: &str| {
            let error = read(hidden, edges).unwrap_err();
            assert!(error.contains(word), "{error}");
        };
        refused(r#""sin""#, "[11,11,1.0]", "cycle");
        refused(
            r#""sin","sin""#,
            "[0,11,1.0],[11,12,1.0],[12,11,1.0]",
            "cycle",
        );
        refused("", "[0,11,1.0]", "0 → 11");
        refused("", "[99,4,1.0]", "99 → 4");
        refused("", "[4,5,1.0]", "4 → 5");
        refused("", "[0,3,1.0]", "0 → 3");
        refused("", "[0,4,1.0],[0,4,0.5]", "twice");
        refused("", "[0,4,null]", "null");
        refused(r#""squash""#, "[0,11,1.0]", "hidden[0]");
        refused(r#""tanh""#, "", "tanh");
        refused(&vec![r#""sin""#; 1001].join(","), "", "1001");
    }

    #[test]
    fn other_versions_and_unknown_keys_are_refused() {
        let text = serde_json::to_string(&Cppn::initial()).unwrap();
        let error = |text: &str| serde_json::from_str::<Cppn>(text).unwrap_err().to_string();
        assert!(error(&text.replace("\"version\":1", "\"version\":2")).contains("version 2"));
        assert!(error(&text.replace("\"hidden\"", "\"hiden\"")).contains("hiden"));
        assert!(error(&text.replacen("\"squash\",", "", 1)).contains("6 functions"));
    }

    #[test]
    fn weights_must_be_finite() {
        let file = |weight| CppnFile {
            version: VERSION,
            outputs: vec![Function::Squash; OUTPUTS],
            hidden: vec![],
            edges: vec![Edge {
                from: 0,
                to: 4,
                weight,
            }],
        };
        assert!(Cppn::try_from(file(1e300)).is_ok());
        for weight in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(Cppn::try_from(file(weight)), Err(CppnError::Weight(0, 4)));
        }
    }

    proptest! {
        #[test]
        fn any_edges_are_a_network_or_a_typed_error(
            hidden in 0..6usize,
            edges in prop::collection::vec((0..18usize, 0..18usize, -2.0..2.0f64), 0..30),
        ) {
            let edges = edges.into_iter().map(Edge::from).collect();
            let (outputs, hidden) = (vec![Function::Squash; OUTPUTS], vec![Function::Square; hidden]);
            if let Ok(cppn) = Cppn::try_from(CppnFile { version: VERSION, outputs, hidden, edges }) {
                prop_assert_eq!(cppn.topological_order().len(), cppn.node_count());
                prop_assert_eq!(cppn.express(5, 4).unwrap().voxels().area(), 20);
            }
        }
    }
}
