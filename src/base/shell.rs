//! Words of command lines for people to copy: [`quoted`] for any word, [`in_shell`] for paths.

use crate::base::text::is_unseen;
use std::ffi::OsStr;
use std::path::Path;

/// Quotes a path for a shell, so that it is never taken for an option.
pub(crate) fn in_shell(path: &Path) -> String {
    match path.as_os_str().as_encoded_bytes().starts_with(b"-") {
        true => quoted(Path::new(".").join(path)),
        false => quoted(path),
    }
}

/// Quotes a word for a shell if it is not plain. Escapes bytes that are not UTF-8 and characters
/// that a terminal would obey or not display (`$'\377'`: Bash, Zsh and POSIX 2024 read it).
pub(crate) fn quoted(word: impl AsRef<OsStr>) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_-./:@%+,".contains(c);
    match word.as_ref().to_str() {
        Some(text) if !text.is_empty() && text.chars().all(is_plain) => text.to_string(),
        Some(text) if !text.contains(is_unseen) => format!("'{}'", text.replace('\'', r"'\''")),
        _ => escaped(word.as_ref().as_encoded_bytes()),
    }
}

fn escaped(bytes: &[u8]) -> String {
    let octal = |bytes: &[u8]| {
        bytes
            .iter()
            .map(|byte| format!("\\{byte:03o}"))
            .collect::<String>()
    };
    let seen = |c: char| match is_unseen(c) || c == '\'' || c == '\\' {
        true => octal(c.encode_utf8(&mut [0; 4]).as_bytes()),
        false => c.to_string(),
    };
    let chunk = |chunk: std::str::Utf8Chunk| {
        chunk.valid().chars().map(seen).collect::<String>() + &octal(chunk.invalid())
    };
    format!("$'{}'", bytes.utf8_chunks().map(chunk).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_words_stay_and_others_are_in_quotes() {
        for plain in ["runs/a-1/run.json", "größe/雪", "10,11", "a:b@c+d%e"] {
            assert_eq!(quoted(plain), plain);
        }
        assert_eq!(
            ["", "a b", "4|9", "~", "$x", "it's"].map(quoted),
            ["''", "'a b'", "'4|9'", "'~'", "'$x'", r"'it'\''s'"]
        );
        assert_eq!(quoted("a\nb'\\\u{202e}"), r"$'a\012b\047\134\342\200\256'");
        assert_eq!([in_shell(Path::new("-x")), quoted("-1")], ["./-x", "-1"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_shell_reads_the_same_bytes() {
        use std::os::unix::ffi::OsStrExt;
        let words: [&[u8]; 7] = [
            b"",
            b"a b",
            b"it's \"$HOME\" `x` \\ !",
            b"\xff\xfe7",
            b"a\n\t7'\\\xff",
            b"*?[a]{b,c}",
            "雪\u{202e}".as_bytes(),
        ];
        for word in words {
            let script = format!("printf %s {}", quoted(OsStr::from_bytes(word)));
            match std::process::Command::new("bash")
                .args(["-c", &script])
                .output()
            {
                Ok(output) => assert_eq!(output.stdout, word, "{script}"),
                Err(_) => return,
            }
        }
    }
}
