//! `morphcog replay` as a film: by a stand-in for ffmpeg, and by the real one where there is one.

#![cfg(unix)]

use crate::common::program::{Made, Said, Sandbox, said};
use std::os::unix::fs::PermissionsExt;
use std::sync::OnceLock;

/// Notes its arguments and the bytes that it reads, and writes a film.
const ENCODER: &str = "#!/bin/sh
here=$(dirname \"$0\")
printf '%s\\n' \"$@\" > \"$here/arguments\"
wc -c > \"$here/bytes\"
for last; do :; done
printf film > \"$last\"
";

/// Writes half of a film, complains and fails, without reading any picture.
const FAILING: &str = "#!/bin/sh
for last; do :; done
printf half > \"$last\"
echo 'a first line' >&2
echo 'Unknown encoder' >&2
exit 8
";

/// A sandbox with a finished tiny run in `run`.
fn with_run() -> Sandbox {
    static RUN: OnceLock<Made> = OnceLock::new();
    Sandbox::once(&RUN, |sandbox| {
        let tiny = Sandbox::tiny().read("tiny.toml");
        sandbox.write("tiny.toml", tiny);
        sandbox.run("evolve -q -c tiny.toml -o run").ended(0, &[]);
    })
}

fn with_encoder(sandbox: &Sandbox, script: &str) -> String {
    let path = sandbox.write("tools/encoder", script);
    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o755)).unwrap();
    path.to_str().unwrap().to_string()
}

fn replay(sandbox: &Sandbox, encoder: &str, line: &str) -> Said {
    let line = format!("replay -a run -i 0 --width 321 {line}");
    let mut command = sandbox.command(line.split(' '));
    command.env("MORPHCOG_FFMPEG", encoder);
    said(command)
}

/// The names in a folder, in order.
fn names(sandbox: &Sandbox, folder: &str) -> Vec<String> {
    let entries = std::fs::read_dir(sandbox.path(folder)).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Frames of the tiny run's replay: 21 of its walk, of which the last is held for 0.6 s.
const FRAMES: usize = 20 + 30;

#[test]
fn a_film_is_made_of_every_frame_in_a_form_that_plays_everywhere() {
    let sandbox = with_run();
    let encoder = with_encoder(&sandbox, ENCODER);
    for (ending, codec) in [("mp4", "libx264"), ("webm", "libvpx-vp9")] {
        let path = format!("walk.{ending}");
        let made = replay(&sandbox, &encoder, &format!("-o {path}")).ended(0, &[]);
        assert!(made.out.contains(&format!("wrote {path}")), "{made:?}");
        assert_eq!(sandbox.read(&path), "film");
        let arguments = sandbox.read("tools/arguments");
        let arguments: Vec<&str> = arguments.lines().collect();
        let after = |name: &str| {
            let place = arguments.iter().position(|argument| *argument == name);
            arguments[place.unwrap() + 1]
        };
        assert_eq!(after("-c:v"), codec);
        assert_eq!(after("-framerate"), "50");
        assert_eq!(
            (after("-pix_fmt"), after("-pixel_format")),
            ("yuv420p", "rgb24")
        );
        // An odd width is made even by the encoder.
        assert!(after("-vf").starts_with("pad=ceil(iw/2)*2"));
        let [width, height] = after("-video_size")
            .split_once('x')
            .map(|(w, h)| [w, h])
            .unwrap();
        assert_eq!(width, "321");
        let bytes: usize = sandbox.read("tools/bytes").trim().parse().unwrap();
        assert_eq!(bytes, 3 * 321 * height.parse::<usize>().unwrap() * FRAMES);
        assert!(arguments.last().unwrap().ends_with(&format!(".{ending}")));
    }
    // Half of the frames at half of the rate: the robot's own time, too.
    replay(&sandbox, &encoder, "-o walk.mp4 --every 2 --fps 25").ended(0, &[]);
    assert!(sandbox.read("tools/arguments").contains("-framerate\n25\n"));
}

#[test]
fn an_encoder_that_fails_or_is_missing_is_told_in_a_line_and_leaves_no_film() {
    let sandbox = with_run();
    let encoder = with_encoder(&sandbox, FAILING);
    let before = names(&sandbox, "");
    let failed = replay(&sandbox, &encoder, "-o walk.mp4");
    let failed = failed.ended(1, &["exit status: 8: Unknown encoder", "--format frames"]);
    assert!(!failed.err.contains("a first line"), "{failed:?}");
    let missing = replay(&sandbox, "no-such-encoder", "-o walk.mp4");
    missing.ended(
        1,
        &["no-such-encoder", "MORPHCOG_FFMPEG", "--format frames"],
    );
    assert_eq!(names(&sandbox, ""), before);
    // A film that was there stays.
    sandbox.write("walk.mp4", "old");
    replay(&sandbox, &encoder, "-o walk.mp4").ended(1, &[]);
    assert_eq!(sandbox.read("walk.mp4"), "old");
}

#[test]
fn single_pictures_are_numbered_in_a_new_folder_with_the_line_that_makes_a_film() {
    let sandbox = with_run();
    let made = replay(&sandbox, "unused", "-o frames/").ended(0, &["frames/frame-%05d.png"]);
    assert!(made.out.contains("wrote frames/"), "{made:?}");
    let expected: Vec<String> = (1..=FRAMES).map(|n| format!("frame-{n:05}.png")).collect();
    assert_eq!(names(&sandbox, "frames"), expected);
    // Pictures of two films in one folder would be one wrong film.
    let again = replay(&sandbox, "unused", "-o frames/ --every 9");
    again.ended(5, &["frames/", "--out"]);
    assert_eq!(names(&sandbox, "frames").len(), FRAMES);
    replay(&sandbox, "unused", "-f frames").ended(0, &[]);
    let run = names(&sandbox, "run");
    assert!(run.iter().any(|name| name.ends_with("-frames")), "{run:?}");
    assert!(!run.iter().any(|name| name.ends_with(".tmp")), "{run:?}");
}

#[test]
fn frames_are_refused_before_the_simulation_where_something_is_in_the_way() {
    let sandbox = with_run();
    let again = |line: &str| {
        let line = format!("replay -a run --every 9 {line}");
        sandbox.run(&line).ended(5, &["frames: ", "--out"]);
    };
    replay(&sandbox, "unused", "-f frames").ended(0, &[]);
    let before = names(&sandbox, "run");
    again("-f frames");
    again("-f gif,frames");
    assert_eq!(names(&sandbox, "run"), before);
    sandbox.write("walk-frames", "a file");
    again("-f gif,frames -o walk");
    sandbox.write("other-frames", "a file");
    again("-f frames -o other-frames");
    assert_eq!(sandbox.read("other-frames"), "a file");
    assert!(!names(&sandbox, "").contains(&"walk.gif".to_string()));
}

/// Interrupts the program before it reads any picture, as Ctrl-C does.
const INTERRUPTING: &str = "#!/bin/sh
kill -INT $PPID
cat > /dev/null
for last; do :; done
printf film > \"$last\"
";

#[test]
fn a_stopped_replay_leaves_neither_a_film_nor_frames_behind() {
    let sandbox = with_run();
    let encoder = with_encoder(&sandbox, INTERRUPTING);
    std::fs::create_dir(sandbox.path("temporary")).unwrap();
    let before = names(&sandbox, "");
    let command = |line: &str| {
        let mut command = sandbox.command(format!("replay -a run -i 0 {line}").split(' '));
        command.env("MORPHCOG_FFMPEG", &encoder);
        command.env("TMPDIR", sandbox.path("temporary"));
        command
    };
    said(command("-o walk.mp4")).ended(75, &["stopped"]);
    assert_eq!(names(&sandbox, ""), before);
    assert_eq!(names(&sandbox, "temporary"), [""; 0]);

    let mut child = command("-o frames/ --width 4096").spawn().unwrap();
    let has_begun = || {
        let all = names(&sandbox, "");
        let temporary = all.iter().find(|name| name.ends_with(".tmp"));
        temporary.is_some_and(|name| !names(&sandbox, name).is_empty())
    };
    while !has_begun() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let pid = child.id().to_string();
    let sent = std::process::Command::new("kill")
        .args(["-INT", &pid])
        .status();
    assert!(sent.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(75));
    assert_eq!(names(&sandbox, ""), before);
}

#[test]
fn ffmpeg_makes_a_film_and_takes_the_line_for_single_pictures() {
    let has = |name: &str| {
        std::process::Command::new(name)
            .arg("-version")
            .output()
            .is_ok()
    };
    if !has("ffmpeg") || !has("ffprobe") {
        eprintln!("skipped: no ffmpeg");
        return;
    }
    let sandbox = with_run();
    let probed = |path: &str| {
        let mut command = std::process::Command::new("ffprobe");
        let keys = "stream=codec_name,width,pix_fmt,nb_read_frames";
        command
            .current_dir(sandbox.path(""))
            .args(["-v", "error", "-count_frames"]);
        let found = command
            .args(["-show_entries", keys, "-of", "csv=p=0", path])
            .output();
        String::from_utf8(found.unwrap().stdout)
            .unwrap()
            .trim()
            .to_string()
    };
    replay(&sandbox, "ffmpeg", "-o walk.mp4").ended(0, &[]);
    assert_eq!(probed("walk.mp4"), format!("h264,322,yuv420p,{FRAMES}"));
    let first = std::fs::read(sandbox.path("walk.mp4")).unwrap();
    replay(&sandbox, "ffmpeg", "-o walk.mp4").ended(0, &[]);
    assert!(std::fs::read(sandbox.path("walk.mp4")).unwrap() == first);
    let line = replay(&sandbox, "", "-o frames/").ended(0, &[]).err;
    let line = line
        .lines()
        .find_map(|line| line.split_once(": ffmpeg"))
        .unwrap()
        .1;
    let mut shell = std::process::Command::new("sh");
    shell
        .current_dir(sandbox.path(""))
        .args(["-c", &format!("ffmpeg -v error {line}")]);
    assert!(shell.status().unwrap().success());
    assert_eq!(probed("film.mp4"), format!("h264,322,yuv420p,{FRAMES}"));
}
