//! The house's plan (`src/lib.rs`) holds: what neither the compiler nor clippy (`clippy.toml`,
//! `src/lib.rs`) can hold.

use std::path::{Path, PathBuf};

/// Rooms with their floors. A room uses only rooms on lower floors. The simulator is a crate of its
/// own, of which `base` and `body` pass on what does not simulate.
const ROOMS: [(&str, u8); 15] = [
    ("base", 0),
    ("body", 1),
    ("sim", 2),
    ("genome", 2),
    ("qd", 2),
    ("baseline", 2),
    ("data", 2),
    ("task", 3),
    ("config", 4),
    ("store", 5),
    ("search", 6),
    ("analysis", 7),
    ("commands", 8),
    ("view", 9),
    ("serve", 10),
];
const CLI_FLOOR: u8 = 11;
/// From this floor on, work comes without a pool of threads; below, it is called in one.
const DRAWS: u8 = 9;

/// Source without comments and without what stands in quotes; lines stay lines.
fn bare(source: &str) -> String {
    let text: Vec<char> = source.chars().collect();
    let at = |i: usize| text.get(i).copied().unwrap_or('\0');
    let word = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = String::new();
    let mut i = 0;
    while i < text.len() {
        let begin = i;
        if at(i) == '/' && at(i + 1) == '/' {
            while i < text.len() && at(i) != '\n' {
                i += 1;
            }
        } else if at(i) == '/' && at(i + 1) == '*' {
            let mut depth = 0;
            loop {
                match (at(i), at(i + 1)) {
                    ('/', '*') => (depth, i) = (depth + 1, i + 2),
                    ('*', '/') => (depth, i) = (depth - 1, i + 2),
                    _ => i += 1,
                }
                if depth == 0 || i >= text.len() {
                    break;
                }
            }
        } else if at(i) == 'r'
            && (i == 0 || !word(at(i - 1)) || at(i - 1) == 'b')
            && raw_hashes(&text, i).is_some()
        {
            let hashes = raw_hashes(&text, i).unwrap();
            i += hashes + 2;
            while i < text.len() && !(at(i) == '"' && (1..=hashes).all(|h| at(i + h) == '#')) {
                i += 1;
            }
            i += hashes + 1;
        } else if at(i) == '"' {
            i += 1;
            while i < text.len() && at(i) != '"' {
                i += if at(i) == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if at(i) == '\'' && (at(i + 1) == '\\' || at(i + 2) == '\'') {
            i += if at(i + 1) == '\\' { 3 } else { 2 };
            while i < text.len() && at(i) != '\'' {
                i += 1;
            }
            i += 1;
        } else {
            out.push(at(i));
            i += 1;
            continue;
        }
        out.extend(text[begin..i.min(text.len())].iter().filter(|c| **c == '\n'));
        out.push(' ');
    }
    out
}

/// For the beginning of a raw string, its number of hashes.
fn raw_hashes(text: &[char], start: usize) -> Option<usize> {
    let hashes = text[start + 1..].iter().take_while(|c| **c == '#').count();
    (text.get(start + 1 + hashes) == Some(&'"')).then_some(hashes)
}

/// Words and single signs.
fn tokens(bare: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut rest = bare.trim_start();
    while let Some(first) = rest.chars().next() {
        let word = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        let (token, after) = rest.split_at(if word > 0 { word } else { first.len_utf8() });
        found.push(token);
        rest = after.trim_start();
    }
    found
}

/// Names that follow `crate::`, alone or in braces.
fn rooms_used<'a>(tokens: &[&'a str]) -> Vec<&'a str> {
    let mut used = Vec::new();
    for (i, window) in tokens.windows(4).enumerate() {
        match window {
            ["crate", ":", ":", "{"] => {
                let mut depth = 0;
                for (at, token) in tokens.iter().enumerate().skip(i + 3) {
                    match *token {
                        "{" => depth += 1,
                        "}" => depth -= 1,
                        name if depth == 1 && matches!(tokens[at - 1], "{" | ",") => used.push(name),
                        _ => {}
                    }
                    if depth == 0 {
                        break;
                    }
                }
            }
            ["crate", ":", ":", name] => used.push(name),
            _ => {}
        }
    }
    used
}

fn floor(room: &str) -> Option<u8> {
    let found = ROOMS.iter().find(|(name, _)| *name == room).map(|(_, floor)| *floor);
    found.or((room == "cli").then_some(CLI_FLOOR))
}

/// What is against the plan in a file; `path` from `src`, with `/`.
fn violations(path: &str, source: &str) -> Vec<String> {
    let room = path.split('/').next().unwrap_or(path).trim_end_matches(".rs");
    let is_top = matches!(path, "main.rs" | "lib.rs");
    let bare = bare(source);
    let all = tokens(&bare);
    let mut found = Vec::new();
    let mut refuse = |what: String| found.push(format!("src/{path}: {what}"));

    match floor(room) {
        _ if is_top => {}
        None => refuse(format!("the room {room} has no floor")),
        Some(own) => {
            for used in rooms_used(&all) {
                if used != room && floor(used).is_none_or(|floor| floor >= own) {
                    refuse(format!("uses crate::{used}, which is on no lower floor"));
                }
            }
            if all.windows(4).any(|w| matches!(w, ["super", ":", ":", "super"])) {
                refuse("super::super hides which room is meant; write crate::".to_string());
            }
        }
    }
    if !(is_top || matches!(path, "base/mod.rs" | "body.rs")) && all.contains(&"morphcog_sim") {
        refuse("the simulator is crate::sim".to_string());
    }
    if path != "base/random.rs" && all.iter().any(|t| matches!(*t, "rand" | "rand_pcg" | "rand_core")) {
        refuse("random numbers come from base/random.rs only".to_string());
    }
    if path != "base/threads.rs" {
        let is_made = |w: &[&str]| matches!(w, ["thread", ":", ":", "spawn" | "scope" | "Builder"]);
        let code = tokens(bare.split("mod tests").next().unwrap_or_default());
        if code.windows(4).any(is_made) || code.contains(&"ThreadPoolBuilder") {
            refuse("threads are made in base/threads.rs only, where none left is an error".to_string());
        }
        let is_parallel = code.windows(4).any(|w| matches!(w, ["rayon", ":", ":", "prelude"]));
        let uses_pools = is_parallel && floor(room).is_some_and(|own| own >= DRAWS);
        if uses_pools && !code.iter().any(|token| matches!(*token, "in_pool" | "install")) {
            refuse("rayon's own pool, which panics where no threads are left: use in_pool".to_string());
        }
    }
    if !(is_top || room == "cli") && all.iter().any(|t| *t == "clap" || t.starts_with("clap_")) {
        refuse("clap belongs to the command line".to_string());
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
    assert!(!found.is_empty(), "{}", folder.display());
    found
}

#[test]
fn every_source_file_keeps_to_the_plan() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = sources(&src);
    files.sort();
    assert!(files.len() > 50);
    let check = |file: &PathBuf| {
        let path = file.strip_prefix(&src).unwrap().components();
        let names: Vec<_> = path.map(|part| part.as_os_str().to_string_lossy()).collect();
        violations(&names.join("/"), &std::fs::read_to_string(file).unwrap())
    };
    let found: Vec<String> = files.iter().flat_map(check).collect();
    assert!(found.is_empty(), "{found:#?}");
}

/// Lines with a number of decimals of their own.
fn own_decimals(source: &str) -> Vec<&str> {
    let code = source.split("#[cfg(test)]").next().unwrap_or_default();
    let has = |line: &&str| {
        let specs = line.split('{').skip(1).filter_map(|rest| rest.split('}').next()?.split_once(':'));
        let mut specs = specs.map(|(_, spec)| spec.trim_start_matches(['+', '>', '<']));
        !line.trim_start().starts_with("//")
            && specs.any(|spec| spec.starts_with('.') && !spec.ends_with('e'))
    };
    code.lines().filter(has).collect()
}

#[test]
fn numbers_for_people_are_made_in_one_place_where_none_is_minus_nothing() {
    assert_eq!(own_decimals("f(\"{x:.2} {:+.1}\")\nf(\"{x}\")\n// {:.1}\nf(\"{d:.n$}\")").len(), 2);
    // A file for programs with every digit, and one column of seconds.
    let exempt = ["base/number.rs", "commands/simulate.rs", "store/metrics.rs"];
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for path in sources(&root) {
        let source = std::fs::read_to_string(&path).unwrap();
        let found = own_decimals(&source);
        let is_exempt = exempt.iter().any(|name| path.ends_with(name));
        assert!(is_exempt || found.is_empty(), "{}: base::number has it: {found:?}", path.display());
    }
}

/// Outside of these, a pipe or a device in the place of a file would block or fill the memory.
#[test]
fn files_are_opened_in_one_place_that_refuses_pipes_and_devices() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for path in sources(&root).into_iter().filter(|path| !path.ends_with("base/files.rs")) {
        let source = std::fs::read_to_string(&path).unwrap();
        let bare = bare(source.split("#[cfg(test)]\nmod tests").next().unwrap());
        // What the kernel says of a process is no file of a user's.
        let lines = source.lines().zip(bare.lines()).filter(|(line, _)| !line.contains("\"/proc/self/"));
        let found: Vec<&str> = lines
            .map(|(_, bare)| bare.trim())
            .filter(|bare| ["fs::read(", "fs::read_to_string("].iter().any(|call| bare.contains(call)))
            .collect();
        assert!(found.is_empty(), "{}: base::files has it: {found:?}", path.display());
    }
}

/// Paths that follow `crate::`, each as far as it is written, braces opened.
fn paths<'a>(tokens: &[&'a str]) -> Vec<Vec<&'a str>> {
    let mut found = Vec::new();
    let mut at = 0;
    while at + 2 < tokens.len() {
        if tokens[at..at + 3] == ["crate", ":", ":"] {
            at = branch(tokens, at + 3, &[], &mut found);
        } else {
            at += 1;
        }
    }
    found
}

/// Reads one path from a place on, after a prefix; where it ends.
fn branch<'a>(tokens: &[&'a str], mut at: usize, prefix: &[&'a str], found: &mut Vec<Vec<&'a str>>) -> usize {
    let mut path = prefix.to_vec();
    loop {
        match tokens.get(at).copied() {
            Some("{") => {
                at += 1;
                while at < tokens.len() && tokens[at] != "}" {
                    at = if tokens[at] == "," { at + 1 } else { branch(tokens, at, &path, found) };
                }
                return at + 1;
            }
            Some(name) => path.push(name),
            None => break,
        }
        at += 1;
        if tokens.get(at..at + 2) != Some(&[":", ":"]) {
            break;
        }
        at += 2;
    }
    found.push(path);
    at
}

#[test]
fn no_import_cycle_has_more_than_two_files() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let name = |file: &PathBuf| {
        let path = file.strip_prefix(&src).unwrap().with_extension("");
        let names: Vec<String> = path.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        names.join("::").trim_end_matches("::mod").to_string()
    };
    let files = sources(&src);
    let modules: Vec<String> = files.iter().map(&name).collect();
    let uses = |file: &PathBuf| -> Vec<usize> {
        let source = std::fs::read_to_string(file).unwrap();
        let bare = bare(source.split("#[cfg(test)]\nmod tests").next().unwrap());
        let own = name(file);
        let resolved = paths(&tokens(&bare)).into_iter().filter_map(|path| {
            let longest = (1..=path.len()).rev().map(|count| path[..count].join("::"));
            longest.filter_map(|path| modules.iter().position(|module| *module == path)).next()
        });
        resolved.filter(|used| modules[*used] != own).collect()
    };
    let graph: Vec<Vec<usize>> = files.iter().map(uses).collect();
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
    assert!(graph.iter().map(Vec::len).sum::<usize>() > 500, "imports are found");
    for (number, module) in modules.iter().enumerate() {
        let cycle: Vec<&String> = (0..graph.len())
            .filter(|other| reached[number][*other] && reached[*other][number])
            .map(|other| &modules[other])
            .collect();
        assert!(cycle.len() <= 2, "{module} is in an import cycle: {cycle:?}");
    }
}

#[test]
fn the_map_in_lib_rs_names_every_room() {
    let lib = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    let rooms = lib.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    assert!(lib.contains("[`sim`]"));
    for room in rooms {
        assert!(floor(room).is_some(), "{room} has no floor");
        assert!(lib.contains(&format!("`{room}`")), "{room} is not in the map");
    }
}

#[test]
fn what_is_against_the_plan_is_found() {
    let found = |path: &str, source: &str| violations(path, source).len();
    assert_eq!(found("task/score.rs", "use crate::base::Grid;\nuse crate::sim::Physics;"), 0);
    assert_eq!(found("genome/mod.rs", "use crate::body::Body;\nuse crate::sim::World;"), 1);
    assert_eq!(found("genome/mod.rs", "use morphcog_sim::World;"), 1);
    assert_eq!(found("qd/archive.rs", "use crate::genome::Genome;"), 1);
    assert_eq!(found("qd/archive.rs", "use crate::{base::{Grid, hash}, task::score, store};"), 2);
    assert_eq!(found("task/score.rs", "fn f() -> crate::store::Error { crate::sim::f() }"), 1);
    assert_eq!(found("search/train/mod.rs", "use crate::store::Error; use crate::view::Scene;"), 1);
    assert_eq!(found("search/train/mod.rs", "use super::super::super::view::Scene;"), 1);
    assert_eq!(found("attic/old.rs", ""), 1);
    assert_eq!(
        found(
            "qd/archive.rs",
            "// use crate::genome::Genome;\n/* crate::store */ const X: &str = \"crate::store\";"
        ),
        0
    );
    assert_eq!(found("qd/archive.rs", "const X: &str = r#\"a \"crate::store\" \"#; use crate::store;"), 1);
    assert_eq!(
        found("qd/archive.rs", "fn f<'a>(c: char) { if c == '\"' || c == '\\'' { crate::store::f() } }"),
        1
    );
    assert_eq!(found("task/score.rs", "use rand::Rng;"), 1);
    assert_eq!(found("task/score.rs", "fn f() { std::thread::spawn(f); } mod tests { thread::scope }"), 1);
    assert_eq!(found("view/gif.rs", "use rayon::prelude::*; fn f() { a.par_iter(); }"), 1);
    assert_eq!(found("view/gif.rs", "use rayon::prelude::*; fn f() { in_pool(|| a.par_iter()); }"), 0);
    assert_eq!(found("config/mod.rs", "#[derive(clap::Args)] struct A;"), 1);
}
