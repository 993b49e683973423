//! The layers and the rules of CONTRIBUTING.md hold: what neither the compiler nor clippy
//! (`clippy.toml`, `src/lib.rs`) can hold, in `src` and in the simulator's crate.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use quote::ToTokens;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use syn::{Attribute, Item};

/// Modules with their layers, the one table of them (`src/lib.rs` explains it). A module uses only
/// modules of lower layers. The simulator is a crate of its own, of which `base` and `body` pass on
/// what does not simulate.
const LAYERS: [(&str, u8); 22] = [
    ("base", 0),
    ("shipped", 1),
    ("body", 1),
    ("sim", 2),
    ("genome", 2),
    ("qd", 2),
    ("baseline", 2),
    ("data", 2),
    ("task", 3),
    ("evogym", 3),
    ("response", 4),
    ("config", 5),
    ("store", 6),
    ("images", 7),
    ("robots", 8),
    ("search", 9),
    ("training", 10),
    ("analysis", 10),
    ("draw", 11),
    ("commands", 12),
    ("serve", 13),
    ("cli", 14),
];
/// Modules that are called without a pool of threads; all others work in one.
const WITHOUT_POOL: [&str; 3] = ["draw", "serve", "cli"];

/// What the rules see of a source: words, signs, and the values of literals; no comment.
#[derive(Clone, Debug, PartialEq)]
enum Token {
    Word(String),
    Sign(char),
    Literal(String),
}

impl Token {
    fn is(&self, word: &str) -> bool {
        match self {
            Token::Word(own) => own == word,
            Token::Sign(own) => word.chars().eq([*own]),
            Token::Literal(_) => false,
        }
    }
}

/// A source, with its tests and without.
struct Source {
    all: Vec<Token>,
    code: Vec<Token>,
}

impl Source {
    fn parse(text: &str) -> Self {
        let file = syn::parse_file(text).expect("sources compile");
        let is_test = |item: &&Item| attributes(item).iter().any(is_cfg_test);
        let mut source = Source {
            all: Vec::new(),
            code: Vec::new(),
        };
        for item in &file.items {
            add(item.to_token_stream(), &mut source.all);
            if !is_test(&item) {
                add(item.to_token_stream(), &mut source.code);
            }
        }
        source
    }

    fn read(path: &Path) -> Self {
        Source::parse(&std::fs::read_to_string(path).unwrap())
    }
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Mod(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

fn is_cfg_test(attribute: &Attribute) -> bool {
    attribute.path().is_ident("cfg") && attribute.to_token_stream().to_string().contains("(test)")
}

fn add(tokens: TokenStream, found: &mut Vec<Token>) {
    let mut tokens = tokens.into_iter().peekable();
    while let Some(token) = tokens.next() {
        match token {
            TokenTree::Ident(word) => found.push(Token::Word(word.to_string())),
            // Comments that document are attributes.
            TokenTree::Punct(sign) if sign.as_char() == '#' => {
                let is_doc = |group: &TokenTree| {
                    group
                        .to_string()
                        .trim_start_matches('[')
                        .trim_start()
                        .starts_with("doc")
                };
                if tokens.next_if(is_doc).is_none() {
                    found.push(Token::Sign('#'));
                }
            }
            TokenTree::Punct(sign) => found.push(Token::Sign(sign.as_char())),
            TokenTree::Literal(literal) => {
                let text = syn::parse_str::<syn::LitStr>(&literal.to_string());
                found.push(Token::Literal(
                    text.map_or(literal.to_string(), |text| text.value()),
                ));
            }
            TokenTree::Group(group) => {
                let signs = match group.delimiter() {
                    Delimiter::Parenthesis => Some(['(', ')']),
                    Delimiter::Brace => Some(['{', '}']),
                    Delimiter::Bracket => Some(['[', ']']),
                    Delimiter::None => None,
                };
                found.extend(signs.map(|[open, _]| Token::Sign(open)));
                add(group.stream(), found);
                found.extend(signs.map(|[_, close]| Token::Sign(close)));
            }
        }
    }
}

/// Whether these words and signs stand anywhere in this order.
fn has(tokens: &[Token], sequence: &[&str]) -> bool {
    let is_it = |window: &[Token]| {
        window
            .iter()
            .zip(sequence)
            .all(|(token, word)| token.is(word))
    };
    tokens.windows(sequence.len()).any(is_it)
}

/// Paths that follow `crate::`, each as far as it is written, braces opened.
fn paths(tokens: &[Token]) -> Vec<Vec<&str>> {
    let mut found = Vec::new();
    let mut at = 0;
    while at + 2 < tokens.len() {
        let is_begin = tokens[at].is("crate") && tokens[at + 1].is(":") && tokens[at + 2].is(":");
        at = if is_begin {
            branch(tokens, at + 3, &[], &mut found)
        } else {
            at + 1
        };
    }
    found
}

/// Reads one path from a place on, after a prefix; where it ends.
fn branch<'a>(
    tokens: &'a [Token],
    mut at: usize,
    prefix: &[&'a str],
    found: &mut Vec<Vec<&'a str>>,
) -> usize {
    let mut path = prefix.to_vec();
    loop {
        match tokens.get(at) {
            Some(Token::Sign('{')) => {
                at += 1;
                while at < tokens.len() && !tokens[at].is("}") {
                    at = if tokens[at].is(",") {
                        at + 1
                    } else {
                        branch(tokens, at, &path, found)
                    };
                }
                return at + 1;
            }
            Some(Token::Word(name)) => path.push(name),
            Some(Token::Sign('*')) => path.push("*"),
            _ => break,
        }
        at += 1;
        if !(tokens.get(at).is_some_and(|token| token.is(":"))
            && tokens.get(at + 1).is_some_and(|token| token.is(":")))
        {
            break;
        }
        at += 2;
    }
    found.push(path);
    at
}

fn layer(module: &str) -> Option<u8> {
    LAYERS
        .iter()
        .find(|(name, _)| *name == module)
        .map(|(_, layer)| *layer)
}

/// What is against the plan in a file; `path` from `src`, with `/`.
fn violations(path: &str, source: &Source) -> Vec<String> {
    let module = path
        .split('/')
        .next()
        .unwrap_or(path)
        .trim_end_matches(".rs");
    let is_top = matches!(path, "main.rs" | "lib.rs");
    let Source { all, code } = source;
    let mut found = Vec::new();
    let mut refuse = |what: String| found.push(format!("src/{path}: {what}"));
    let own = layer(module);
    if !is_top && own.is_none() {
        refuse(format!("{module} has no layer"));
    }
    if let Some(own) = own {
        for used in paths(all).iter().filter_map(|path| path.first().copied()) {
            if used != module && layer(used).is_none_or(|layer| layer >= own) {
                refuse(format!("uses crate::{used}, which is in no lower layer"));
            }
        }
        if has(all, &["super", ":", ":", "super"]) {
            refuse("super::super hides which module is meant; write crate::".to_string());
        }
    }
    if !(is_top || matches!(path, "base/mod.rs" | "body.rs")) && has(all, &["morphcog_sim"]) {
        refuse("the simulator is crate::sim".to_string());
    }
    if path != "base/random.rs"
        && ["rand", "rand_pcg", "rand_core"]
            .iter()
            .any(|word| has(all, &[word]))
    {
        refuse("random numbers come from base/random.rs only".to_string());
    }
    if path != "base/threads.rs" {
        let makes = |what: &&str| has(code, &["thread", ":", ":", what]);
        if ["spawn", "scope", "Builder"].iter().any(makes) || has(code, &["ThreadPoolBuilder"]) {
            refuse(
                "threads are made in base/threads.rs only, where none left is an error".to_string(),
            );
        }
        let is_parallel =
            has(code, &["rayon", ":", ":", "prelude"]) && WITHOUT_POOL.contains(&module);
        if is_parallel && !["in_pool", "install"].iter().any(|word| has(code, &[word])) {
            refuse(
                "rayon's own pool, which panics where no threads are left: use in_pool".to_string(),
            );
        }
    }
    if !(is_top || module == "cli") {
        if all
            .iter()
            .any(|token| matches!(token, Token::Word(word) if word.starts_with("clap")))
        {
            refuse("clap belongs to the command line".to_string());
        }
        // Other programs have options, too.
        let has_option = |text: &String| path != "data/fetch.rs" && text.contains("--");
        for token in all {
            if let Token::Literal(text) = token
                && has_option(text)
            {
                refuse(format!("options are words of the command line: {text:?}"));
            }
        }
    }
    found
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    fn add(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension() {
                _ if path.is_dir() => add(&path, found),
                Some(ending) if ending == "rs" => found.push(path),
                _ => {}
            }
        }
    }
    let mut found = Vec::new();
    add(folder, &mut found);
    found.sort();
    assert!(!found.is_empty(), "{}", folder.display());
    found
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A path from a folder, with `/`.
fn below(folder: &Path, path: &Path) -> String {
    let path = path.strip_prefix(folder).unwrap().components();
    let names: Vec<_> = path
        .map(|part| part.as_os_str().to_string_lossy())
        .collect();
    names.join("/")
}

#[test]
fn every_source_file_keeps_to_the_plan() {
    let src = root().join("src");
    let files = sources(&src);
    assert!(files.len() > 50);
    let check = |file: &PathBuf| violations(&below(&src, file), &Source::read(file));
    let found: Vec<String> = files.iter().flat_map(check).collect();
    assert!(found.is_empty(), "{found:#?}");
}

/// Literals that format with a number of decimals of their own.
fn own_decimals(source: &Source) -> Vec<&String> {
    let has_own = |text: &&String| {
        let specs = text
            .split('{')
            .skip(1)
            .filter_map(|rest| rest.split('}').next()?.split_once(':'));
        let mut specs = specs.map(|(_, spec)| spec.trim_start_matches(['+', '>', '<']));
        specs.any(|spec| spec.starts_with('.') && !spec.ends_with('e'))
    };
    let literals = source.code.iter().filter_map(|token| match token {
        Token::Literal(text) => Some(text),
        _ => None,
    });
    literals.filter(has_own).collect()
}

#[test]
fn numbers_for_people_are_made_in_one_place_where_none_is_minus_nothing() {
    let example = "fn f() { f(\"{x:.2} {:+.1}\");\nf(\"{x}\");\n// {:.1}\nf(\"{d:.n$}\") }";
    assert_eq!(own_decimals(&Source::parse(example)).len(), 2);
    // A file for programs with every digit, and one column of seconds.
    let exempt = ["base/number.rs", "commands/simulate.rs", "store/metrics.rs"];
    for path in sources(&root().join("src")) {
        let source = Source::read(&path);
        let found = own_decimals(&source);
        let is_exempt = exempt.iter().any(|name| path.ends_with(name));
        assert!(
            is_exempt || found.is_empty(),
            "{}: base::number has it: {found:?}",
            path.display()
        );
    }
}

/// Outside of one module, a pipe or a device in the place of a file would block or fill the memory.
#[test]
fn files_are_opened_in_one_place_that_refuses_pipes_and_devices() {
    let opens = |source: &Source| -> bool {
        source.code.windows(6).any(|window| {
            let is_call = window[0].is("fs") && window[1].is(":") && window[4].is("(");
            // What the kernel says of a process is no file of a user's.
            let is_kernel =
                matches!(&window[5], Token::Literal(path) if path.starts_with("/proc/self/"));
            is_call
                && !is_kernel
                && ["read", "read_to_string"]
                    .iter()
                    .any(|call| window[3].is(call))
        })
    };
    assert!(opens(&Source::parse("fn f() { std::fs::read(path) }")));
    for path in sources(&root().join("src"))
        .into_iter()
        .filter(|path| !path.ends_with("base/files.rs"))
    {
        assert!(
            !opens(&Source::read(&path)),
            "{}: base::files has it",
            path.display()
        );
    }
}

/// Files that import each other, directly or not: each group of them once.
fn cycles(src: &Path) -> Vec<Vec<String>> {
    let name = |file: &PathBuf| {
        let path = below(src, file).replace('/', "::");
        path.trim_end_matches(".rs")
            .trim_end_matches("::mod")
            .to_string()
    };
    let files = sources(src);
    let modules: BTreeMap<String, usize> = files.iter().map(&name).zip(0..).collect();
    let uses = |file: &PathBuf| -> Vec<usize> {
        let (source, own) = (Source::read(file), name(file));
        let resolved = paths(&source.code).into_iter().filter_map(|path| {
            let mut longest = (1..=path.len()).rev().map(|count| path[..count].join("::"));
            longest.find_map(|path| modules.get(&path).copied())
        });
        resolved.filter(|used| *used != modules[&own]).collect()
    };
    let graph: Vec<Vec<usize>> = files.iter().map(uses).collect();
    assert!(
        graph.iter().map(Vec::len).sum::<usize>() > files.len(),
        "imports are found"
    );
    let reached = |from: usize| {
        let (mut seen, mut open) = (vec![false; graph.len()], vec![from]);
        while let Some(next) = open.pop() {
            for &used in &graph[next] {
                if !std::mem::replace(&mut seen[used], true) {
                    open.push(used);
                }
            }
        }
        seen
    };
    let reached: Vec<Vec<bool>> = (0..graph.len()).map(reached).collect();
    let of = |number: usize| {
        let both = |other: &usize| reached[number][*other] && reached[*other][number];
        (0..graph.len())
            .filter(both)
            .map(|other| name(&files[other]))
            .collect::<Vec<_>>()
    };
    let mut all: Vec<Vec<String>> = (0..graph.len())
        .map(of)
        .filter(|cycle| cycle.len() > 1)
        .collect();
    all.sort();
    all.dedup();
    all
}

#[test]
fn import_cycles_are_few_and_of_two_files() {
    let all = [root().join("src"), root().join("crates/sim/src")]
        .map(|src| cycles(&src))
        .concat();
    assert!(
        all.len() <= 3 && all.iter().all(|cycle| cycle.len() == 2),
        "{all:#?}"
    );
}

#[test]
fn the_map_in_lib_rs_has_every_module_in_its_layer() {
    let lib = std::fs::read_to_string(root().join("src/lib.rs")).unwrap();
    let modules = lib
        .lines()
        .filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    assert!(lib.contains("[`sim`]"));
    for module in modules {
        let layer = layer(module).unwrap_or_else(|| panic!("{module} has no layer"));
        assert!(
            lib.contains(&format!("//! | {layer} | [`{module}`] |")),
            "{module} is not in the map"
        );
    }
}

#[test]
fn what_is_against_the_plan_is_found() {
    let found = |path: &str, source: &str| violations(path, &Source::parse(source)).len();
    assert_eq!(
        found(
            "task/score.rs",
            "use crate::base::Grid;\nuse crate::sim::Physics;"
        ),
        0
    );
    assert_eq!(
        found(
            "genome/mod.rs",
            "use crate::body::Body;\nuse crate::sim::World;"
        ),
        1
    );
    assert_eq!(found("genome/mod.rs", "use morphcog_sim::World;"), 1);
    assert_eq!(found("qd/archive.rs", "use crate::genome::Genome;"), 1);
    assert_eq!(
        found(
            "qd/archive.rs",
            "use crate::{base::{Grid, hash}, task::score, store};"
        ),
        2
    );
    assert_eq!(
        found(
            "task/score.rs",
            "fn f() -> crate::store::Error { crate::sim::f() }"
        ),
        1
    );
    assert_eq!(
        found(
            "search/evolve.rs",
            "use crate::store::Error; use crate::draw::Scene;"
        ),
        1
    );
    assert_eq!(
        found("search/evolve.rs", "use super::super::super::draw::Scene;"),
        1
    );
    assert_eq!(found("attic/old.rs", ""), 1);
    let hidden =
        "// use crate::genome::Genome;\n/* crate::store */ const X: &str = \"crate::store\";";
    assert_eq!(found("qd/archive.rs", hidden), 0);
    assert_eq!(
        found(
            "qd/archive.rs",
            "const X: &str = r#\"a \"crate::store\" \"#; use crate::store::A;"
        ),
        1
    );
    assert_eq!(found("task/score.rs", "use rand::Rng;"), 1);
    let tests =
        "fn f() { std::thread::spawn(f); } #[cfg(test)] mod tests { fn f() { thread::scope(f) } }";
    assert_eq!(found("task/score.rs", tests), 1);
    assert_eq!(
        found(
            "draw/gif.rs",
            "use rayon::prelude::*; fn f() { a.par_iter(); }"
        ),
        1
    );
    assert_eq!(
        found(
            "draw/gif.rs",
            "use rayon::prelude::*; fn f() { in_pool(|| a.par_iter()); }"
        ),
        0
    );
    assert_eq!(found("config/mod.rs", "#[derive(clap::Args)] struct A;"), 1);
    assert_eq!(
        found(
            "store/run.rs",
            "/// As `--out`.\nfn f() { f(\"write elsewhere with --out\") }"
        ),
        1
    );
    assert_eq!(
        found("store/run.rs", "fn f() { format!(\"{x}: --set {y}\") }"),
        1
    );
    assert_eq!(
        found("cli/run.rs", "fn f() { f(\"write elsewhere with --out\") }"),
        0
    );
}
