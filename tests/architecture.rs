//! The house's plan (`src/lib.rs`) holds: floors, and the few rules that keep results the same everywhere.

use std::path::{Path, PathBuf};

/// Rooms with their floors. A room uses only rooms on lower floors; below all is the simulator, a crate of its own.
const ROOMS: [(&str, u8); 8] = [
    ("base", 0),
    ("body", 1),
    ("genome", 2),
    ("qd", 2),
    ("baseline", 2),
    ("task", 3),
    ("run", 4),
    ("view", 5),
];
const CLI_FLOOR: u8 = 6;
/// Rooms whose numbers are results: the same bits on every machine.
const EXACT_ROOMS: [&str; 5] = ["base", "body", "genome", "qd", "task"];
/// Functions of the standard library whose last bits differ between systems (`libm` has them, too), and fused multiply-add.
const INEXACT: [&str; 24] = [
    "sin", "cos", "tan", "sin_cos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "exp2",
    "exp_m1", "ln", "log", "log2", "log10", "ln_1p", "powf", "powi", "hypot", "cbrt", "gamma",
];

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

/// Bare source without its tests: the items after `#[cfg(test)]`.
fn without_tests(bare: &str) -> String {
    const MARK: &str = "#[cfg(test)]";
    let mut out = String::new();
    let mut rest = bare;
    while let Some(at) = rest.find(MARK) {
        out += &rest[..at];
        rest = &rest[at + MARK.len()..];
        let end = rest.find(['{', ';']).unwrap_or(rest.len() - 1);
        let mut depth = 0i32;
        let close = rest[end..].char_indices().find(|(_, c)| {
            depth += i32::from(*c == '{') - i32::from(*c == '}');
            depth == 0
        });
        rest = &rest[close.map_or(rest.len(), |(i, c)| end + i + c.len_utf8())..];
    }
    out + rest
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

/// Modules of tests in files of their own: what is declared after `#[cfg(test)]`.
fn test_modules(source: &str) -> Vec<String> {
    let bare = bare(source);
    let after_mark = bare.split("#[cfg(test)]").skip(1).map(tokens);
    let module = |tokens: Vec<&str>| {
        let at = tokens.iter().position(|token| matches!(*token, "{" | ";"))?;
        (tokens[at] == ";" && at >= 2 && tokens[at - 2] == "mod").then(|| tokens[at - 1].to_string())
    };
    after_mark.filter_map(module).collect()
}

/// What is against the plan in a file; `path` from `src`, with `/`. `is_test`: all of it is tests.
fn violations(path: &str, source: &str, is_test: bool) -> Vec<String> {
    let room = path.split('/').next().unwrap_or(path).trim_end_matches(".rs");
    let is_top = matches!(path, "main.rs" | "lib.rs");
    let bare = bare(source);
    let all = tokens(&bare);
    let code = if is_test { String::new() } else { without_tests(&bare) };
    let code = tokens(&code);
    let mut found = Vec::new();
    let mut refuse = |what: String| found.push(format!("src/{path}: {what}"));

    match floor(room) {
        _ if is_top => {}
        None => refuse(format!("the room {room} has no floor")),
        Some(own) => {
            for used in rooms_used(&all) {
                if used != room && used != "sim" && floor(used).is_none_or(|floor| floor >= own) {
                    refuse(format!("uses crate::{used}, which is on no lower floor"));
                }
            }
            if code.windows(4).any(|w| matches!(w, ["super", ":", ":", "super"])) {
                refuse("super::super hides which room is meant; write crate::".to_string());
            }
        }
    }
    if path != "base/random.rs" && all.iter().any(|t| matches!(*t, "rand" | "rand_pcg" | "rand_core")) {
        refuse("random numbers come from base/random.rs only".to_string());
    }
    if !(is_top || room == "cli") && all.iter().any(|t| *t == "clap" || t.starts_with("clap_")) {
        refuse("clap belongs to the command line".to_string());
    }
    for pair in code.windows(2) {
        let is_print = matches!(pair, ["print" | "println" | "eprint" | "eprintln" | "dbg", "!"])
            || matches!(pair, ["stdout" | "stderr" | "Stdout" | "Stderr", "("]);
        if is_print && !matches!(path, "view/console.rs" | "main.rs") {
            refuse(format!("{} belongs to view/console.rs", pair.concat()));
        }
        if matches!(pair, ["panic" | "todo" | "unimplemented" | "unreachable", "!"]) {
            refuse(pair.concat());
        }
    }
    for triple in code.windows(3) {
        if matches!(triple, [".", "unwrap" | "unwrap_err", "("]) {
            refuse(format!("{}: an invariant is expect(\"why it holds\")", triple.concat()));
        }
        if EXACT_ROOMS.contains(&room) && matches!(triple, [".", name, "("] if INEXACT.contains(name)) {
            refuse(format!("{}: differs between machines; libm's is the same everywhere", triple.concat()));
        }
    }
    for path in code.windows(4) {
        if EXACT_ROOMS.contains(&room)
            && matches!(path, ["f64" | "f32", ":", ":", name] if INEXACT.contains(name))
        {
            refuse(format!("{}: differs between machines; libm's is the same everywhere", path.concat()));
        }
    }
    found
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.extension() {
            _ if path.is_dir() => found.extend(sources(&path)),
            Some(ending) if ending == "rs" => found.push(path),
            _ => {}
        }
    }
    found
}

#[test]
fn every_source_file_keeps_to_the_plan() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = sources(&src);
    files.sort();
    assert!(files.len() > 50);
    let texts: Vec<String> = files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
    let is_test = |file: &PathBuf| {
        let folder = |other: &PathBuf| other.parent() == file.parent();
        let name = file.file_stem().unwrap().to_string_lossy();
        let declares = |text: &String| test_modules(text).iter().any(|module| *module == name);
        name.ends_with("_tests")
            || files.iter().zip(&texts).any(|(other, text)| folder(other) && declares(text))
    };
    let check = |(file, text): (&PathBuf, &String)| {
        let path = file.strip_prefix(&src).unwrap().components();
        let names: Vec<_> = path.map(|part| part.as_os_str().to_string_lossy()).collect();
        violations(&names.join("/"), text, is_test(file))
    };
    let found: Vec<String> = files.iter().zip(&texts).flat_map(check).collect();
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
    let exempt = ["base/number.rs", "run/simulate.rs", "run/metrics.rs"];
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for path in sources(&root) {
        let source = std::fs::read_to_string(&path).unwrap();
        let found = own_decimals(&source);
        let is_exempt = exempt.iter().any(|name| path.ends_with(name));
        assert!(is_exempt || found.is_empty(), "{}: base::number has it: {found:?}", path.display());
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
    let found = |path: &str, source: &str| violations(path, source, false).len();
    assert_eq!(found("qd/archive.rs", "use crate::base::Grid;\nuse crate::sim::Physics;"), 0);
    assert_eq!(found("qd/archive.rs", "use crate::genome::Genome;"), 1);
    assert_eq!(found("qd/archive.rs", "use crate::{base::{Grid, hash}, task::idx, run};"), 2);
    assert_eq!(found("task/score.rs", "fn f() -> crate::run::Error { crate::sim::f() }"), 1);
    assert_eq!(found("run/data/fetch.rs", "use crate::run::Error; use crate::view::Scene;"), 1);
    assert_eq!(found("run/data/fetch.rs", "use super::super::super::view::Scene;"), 1);
    assert_eq!(found("attic/old.rs", ""), 1);
    assert_eq!(
        found(
            "qd/archive.rs",
            "// use crate::genome::Genome;\n/* crate::run */ const X: &str = \"crate::run\";"
        ),
        0
    );
    assert_eq!(found("qd/archive.rs", "const X: &str = r#\"a \"crate::run\" \"#; use crate::run;"), 1);
    assert_eq!(
        found("qd/archive.rs", "fn f<'a>(c: char) { if c == '\"' || c == '\\'' { crate::run::f() } }"),
        1
    );
    assert_eq!(found("task/idx.rs", "use rand::Rng;"), 1);
    assert_eq!(
        found("run/eval.rs", "fn f() { println!(\"x\"); eprintln!(); std::io::stdout().flush(); }"),
        3
    );
    assert_eq!(found("view/console.rs", "fn f() { println!(\"x\"); std::io::stderr(); }"), 0);
    assert_eq!(found("run/config.rs", "#[derive(clap::Args)] struct A;"), 1);
    assert_eq!(
        found("qd/archive.rs", "fn f(x: f64) -> f64 { x.sin() + x.powf(2.0) + x.sqrt() + x.abs() }"),
        2
    );
    assert_eq!(found("qd/archive.rs", "fn f(x: f64) -> f64 { f64::exp(x) }"), 1);
    assert_eq!(found("qd/archive.rs", "fn f(x: f64) -> f64 { libm::exp(x) }"), 0);
    assert_eq!(found("view/gif.rs", "fn f(x: f64) -> f64 { x.sin() }"), 0);
    assert_eq!(
        found("view/gif.rs", "fn f() { g().unwrap(); g().expect(\"x\"); g().unwrap_or(1); panic!() }"),
        2
    );
    assert_eq!(
        test_modules("#[cfg(test)]\npub(super) mod wobble;\n#[cfg(test)]\nmod tests { fn f(); }"),
        ["wobble"]
    );
    let tests =
        "fn f() {}\n#[cfg(test)]\nmod tests { fn f(x: f64) { g(\"}\").unwrap(); if x.sin() > 1.0 {} } }\n";
    assert_eq!(found("qd/archive.rs", tests), 0);
    assert_eq!(found("qd/archive.rs", &format!("{tests} fn h() {{ g().unwrap() }}")), 1);
    assert_eq!(found("qd/archive.rs", "#[cfg(test)]\nmod tests;\nfn h() { g().unwrap() }"), 1);
}
