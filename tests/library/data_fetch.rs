//! `morphcog data fetch` against a small HTTP server on this machine, by every program for downloads
//! that is installed: what is not exactly the published file never gets to disk, and the next mirror
//! is tried.

use crate::common::program::{Sandbox, said};
use flate2::Compression;
use flate2::write::GzEncoder;
use morphcog::base::hash::sha256_hex;
use morphcog::base::observer::{Observer, Work};
use morphcog::base::session::Session;
use morphcog::base::stop::NEVER;
use morphcog::data::catalogue::{Catalogue, RemoteFile};
use morphcog::data::fetch::{
    AttemptError, FetchError, FetchOptions, FetchOutcome, Fetched, Program,
};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A mirror with these files (path → body, as sent after `Content-Length: declared`); a body that is an
/// address leads there.
struct Mirror {
    address: String,
    asked: Arc<Mutex<Vec<String>>>,
}

impl Mirror {
    fn serving(files: &[(&str, &[u8])]) -> Self {
        let files = files.iter().map(|(name, body)| (*name, body.len(), *body));
        Mirror::declaring(&files.collect::<Vec<_>>())
    }

    fn declaring(files: &[(&str, usize, &[u8])]) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}/set", listener.local_addr().unwrap());
        let files: BTreeMap<String, (usize, Vec<u8>)> = files
            .iter()
            .map(|(name, declared, body)| (format!("/set/{name}"), (*declared, body.to_vec())))
            .collect();
        let asked = Arc::new(Mutex::new(Vec::new()));
        let log = Arc::clone(&asked);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                answer(stream, &files, &log);
            }
        });
        Mirror { address, asked }
    }

    fn asked(&self) -> Vec<String> {
        self.asked.lock().unwrap().clone()
    }
}

fn answer(
    mut stream: TcpStream,
    files: &BTreeMap<String, (usize, Vec<u8>)>,
    log: &Mutex<Vec<String>>,
) {
    let mut lines = BufReader::new(stream.try_clone().unwrap())
        .lines()
        .map_while(Result::ok);
    let Some(request) = lines.next() else { return };
    lines.take_while(|line| !line.is_empty()).for_each(drop);
    let path = request.split(' ').nth(1).unwrap_or_default().to_string();
    let head = |status: &str, length: usize| {
        format!("HTTP/1.1 {status}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n")
    };
    let reply = match files.get(&path) {
        Some((_, body)) if body.starts_with(b"http://") => {
            let place = String::from_utf8(body.clone()).unwrap();
            head(&format!("302 Found\r\nLocation: {place}"), 0).into_bytes()
        }
        Some((declared, body)) => [head("200 OK", *declared).as_bytes(), body].concat(),
        None => head("404 Not Found", 0).into_bytes(),
    };
    log.lock().unwrap().push(path);
    // A client that has read enough may have gone.
    let _ = stream.write_all(&reply);
}

const IMAGES: &[u8] = b"these are the images";
const LABELS: &[u8] = b"and the labels";

fn catalogue(mirrors: &[&Mirror]) -> Catalogue {
    let file = |name: &str, content: &[u8]| RemoteFile {
        name: name.to_string(),
        bytes: content.len() as u64,
        sha256: sha256_hex(content),
        content_sha256: Some(sha256_hex(content)),
    };
    Catalogue {
        name: "mnist".to_string(),
        mirrors: mirrors.iter().map(|m| m.address.clone()).collect(),
        files: vec![file("images.gz", IMAGES), file("labels.gz", LABELS)],
    }
}

/// The programs that are installed: there must be one.
fn programs() -> Vec<Program> {
    let programs: Vec<Program> = Program::ALL
        .into_iter()
        .filter(|program| program.is_installed())
        .collect();
    assert!(!programs.is_empty(), "neither curl nor wget is installed");
    programs
}

/// Fetches by one program.
fn fetch(
    program: Program,
    catalogue: &Catalogue,
    options: &FetchOptions,
    observer: &dyn Observer,
) -> Result<Vec<Fetched>, FetchError> {
    morphcog::data::fetch::fetch(
        catalogue,
        options,
        &[program],
        &Session::new(&NEVER, observer),
    )
}

fn to(folder: &Path) -> FetchOptions {
    FetchOptions {
        to: Some(folder.to_path_buf()),
        ..FetchOptions::default()
    }
}

fn outcomes(fetched: Result<Vec<Fetched>, FetchError>) -> Vec<FetchOutcome> {
    fetched.unwrap().into_iter().map(|f| f.outcome).collect()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[derive(Default)]
struct Log(Mutex<Vec<String>>);

impl Log {
    fn add(&self, text: String) {
        self.0.lock().unwrap().push(text);
    }

    fn first(&self, count: usize) -> Vec<String> {
        self.0.lock().unwrap()[..count].to_vec()
    }
}

impl Observer for Log {
    fn begins(&self, work: &Work) {
        assert_eq!(work.unit, "bytes");
        self.add(format!("begins {} of {}", work.label, work.total));
    }
    fn progress(&self, done: u64) {
        if done == 20 {
            self.add("received 20".to_string());
        }
    }
    fn warning(&self, text: &str) {
        self.add(text.split(": ").next().unwrap_or_default().to_string());
    }
}

#[test]
fn right_files_are_written_and_then_kept() {
    for program in programs() {
        let mirror = Mirror::serving(&[("images.gz", IMAGES), ("labels.gz", LABELS)]);
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("data/mnist");
        let log = Log::default();
        let fetched = fetch(program, &catalogue(&[&mirror]), &to(&folder), &log);
        let url = |name: &str| FetchOutcome::Downloaded(format!("{}/{name}", mirror.address));
        assert_eq!(outcomes(fetched), [url("images.gz"), url("labels.gz")]);
        assert_eq!(std::fs::read(folder.join("images.gz")).unwrap(), IMAGES);
        assert_eq!(names(&folder), ["images.gz", "labels.gz"]);
        assert_eq!(log.first(2), ["begins images.gz of 20", "received 20"]);

        let again = fetch(program, &catalogue(&[&mirror]), &to(&folder), &());
        assert_eq!(outcomes(again), [FetchOutcome::Kept, FetchOutcome::Kept]);
        assert_eq!(mirror.asked().len(), 2);
        let forced = FetchOptions {
            force: true,
            ..to(&folder)
        };
        fetch(program, &catalogue(&[&mirror]), &forced, &()).unwrap();
        assert_eq!(mirror.asked().len(), 4);
    }
}

#[test]
fn a_file_that_a_mirror_lacks_comes_from_the_next() {
    for program in programs() {
        let first = Mirror::serving(&[("labels.gz", LABELS)]);
        let second = Mirror::serving(&[("images.gz", IMAGES), ("labels.gz", LABELS)]);
        let folder = tempfile::tempdir().unwrap();
        let log = Log::default();
        let fetched = fetch(
            program,
            &catalogue(&[&first, &second]),
            &to(folder.path()),
            &log,
        );
        let url = |mirror: &Mirror, name: &str| {
            FetchOutcome::Downloaded(format!("{}/{name}", mirror.address))
        };
        assert_eq!(
            outcomes(fetched),
            [url(&second, "images.gz"), url(&first, "labels.gz")]
        );
        assert_eq!(
            log.first(3),
            [
                "begins images.gz of 20",
                "begins images.gz of 20",
                "received 20"
            ]
        );
    }
}

#[test]
fn wrong_content_is_refused_and_never_reaches_the_disk() {
    for program in programs() {
        let wrong = Mirror::serving(&[("images.gz", b"those are the images")]);
        let short = Mirror::serving(&[("images.gz", b"these are the")]);
        let long = Mirror::serving(&[("images.gz", b"these are the images and more")]);
        let cut = Mirror::declaring(&[("images.gz", IMAGES.len(), b"these are")]);
        let absent = Mirror::serving(&[]);
        let folder = tempfile::tempdir().unwrap();
        let mirrors = [&wrong, &short, &long, &cut, &absent];
        let error = fetch(program, &catalogue(&mirrors), &to(folder.path()), &()).unwrap_err();
        let message = error.to_string();
        let FetchError::Mirrors { file, attempts, .. } = error else {
            panic!("{message}")
        };
        let errors: Vec<AttemptError> = attempts.into_iter().map(|a| a.error).collect();
        assert_eq!(file, "images.gz");
        assert!(
            matches!(
                errors.as_slice(),
                [
                    AttemptError::Checksum { .. },
                    AttemptError::Size {
                        expected: 20,
                        found: 13
                    },
                    AttemptError::Size {
                        expected: 20,
                        found: 21
                    },
                    // Of a connection that broke off, wget says nothing.
                    AttemptError::Failed {
                        program: Program::Curl,
                        ..
                    } | AttemptError::Size {
                        expected: 20,
                        found: 9
                    },
                    AttemptError::Failed { .. },
                ]
            ),
            "{errors:?}"
        );
        assert!(
            mirrors.iter().all(|m| message.contains(&m.address)),
            "{message}"
        );
        assert!(message.contains("404"), "{message}");
        assert!(names(folder.path()).is_empty());
    }
}

#[test]
fn another_file_of_that_name_is_not_replaced_without_force() {
    for program in programs() {
        let mirror = Mirror::serving(&[("images.gz", IMAGES), ("labels.gz", LABELS)]);
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("labels.gz"), "my own").unwrap();
        let error = fetch(program, &catalogue(&[&mirror]), &to(folder.path()), &()).unwrap_err();
        assert!(
            matches!(error, FetchError::Differs { .. }) && error.to_string().contains("--force"),
            "{error}"
        );
        assert_eq!(names(folder.path()), ["labels.gz"]);
        assert!(mirror.asked().is_empty());

        let forced = FetchOptions {
            force: true,
            ..to(folder.path())
        };
        fetch(program, &catalogue(&[&mirror]), &forced, &()).unwrap();
        assert_eq!(
            std::fs::read(folder.path().join("labels.gz")).unwrap(),
            LABELS
        );
    }
}

#[test]
fn a_mirror_of_ones_own_is_used_instead_of_the_known_ones() {
    for program in programs() {
        let known = Mirror::serving(&[("images.gz", IMAGES), ("labels.gz", LABELS)]);
        let own = Mirror::serving(&[("images.gz", IMAGES), ("labels.gz", LABELS)]);
        let folder = tempfile::tempdir().unwrap();
        let options = FetchOptions {
            mirror: Some(format!("{}/", own.address)),
            ..to(folder.path())
        };
        fetch(program, &catalogue(&[&known]), &options, &()).unwrap();
        assert_eq!(own.asked(), ["/set/images.gz", "/set/labels.gz"]);
        assert!(known.asked().is_empty());
    }
}

#[test]
fn a_dead_mirror_is_an_error_that_names_it() {
    for program in programs() {
        let closed = TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap();
        let folder = tempfile::tempdir().unwrap();
        let options = FetchOptions {
            mirror: Some(format!("http://{closed}")),
            ..to(folder.path())
        };
        let error = fetch(program, &catalogue(&[]), &options, &())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(&closed.to_string()) && error.contains("images.gz"),
            "{error}"
        );
    }
}

#[test]
fn the_published_content_is_kept_however_it_is_packed() {
    for program in programs() {
        let mirror = Mirror::serving(&[("images.gz", IMAGES), ("labels.gz", LABELS)]);
        let folder = tempfile::tempdir().unwrap();
        let mut packed = GzEncoder::new(Vec::new(), Compression::best());
        packed.write_all(IMAGES).unwrap();
        std::fs::write(folder.path().join("images.gz"), packed.finish().unwrap()).unwrap();
        std::fs::write(folder.path().join("labels"), LABELS).unwrap();
        let fetched = fetch(program, &catalogue(&[&mirror]), &to(folder.path()), &());
        assert_eq!(outcomes(fetched), [FetchOutcome::Kept, FetchOutcome::Kept]);
        assert!(mirror.asked().is_empty());

        // One that is not packed and says something else would be as good as the one beside it.
        std::fs::write(folder.path().join("labels"), "my own").unwrap();
        let error = fetch(program, &catalogue(&[&mirror]), &to(folder.path()), &())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("labels: is there but is not the published file"),
            "{error}"
        );
        let forced = FetchOptions {
            force: true,
            ..to(folder.path())
        };
        fetch(program, &catalogue(&[&mirror]), &forced, &()).unwrap();
        assert_eq!(names(folder.path()), ["images.gz", "labels.gz"]);
    }
}

#[test]
fn what_failed_is_said_once_and_no_empty_folder_is_left() {
    for program in programs() {
        let absent = [Mirror::serving(&[]), Mirror::serving(&[])];
        let root = tempfile::tempdir().unwrap();
        let log = Log::default();
        let error = fetch(
            program,
            &catalogue(&[&absent[0], &absent[1]]),
            &to(&root.path().join("data/mnist")),
            &log,
        );
        let error = error.unwrap_err().to_string();
        // Not in a port, such as 40455.
        assert_eq!(error.matches(" 404").count(), 1, "{error}");
        assert!(
            absent
                .iter()
                .all(|mirror| error.matches(&mirror.address).count() == 1),
            "{error}"
        );
        assert!(
            log.0
                .lock()
                .unwrap()
                .iter()
                .all(|text| text.starts_with("begins")),
            "warned of it, too"
        );
        assert!(names(root.path()).is_empty());

        // What was fetched before stays.
        let half = Mirror::serving(&[("images.gz", IMAGES)]);
        fetch(
            program,
            &catalogue(&[&half]),
            &to(&root.path().join("data/mnist")),
            &(),
        )
        .unwrap_err();
        assert_eq!(names(&root.path().join("data/mnist")), ["images.gz"]);
    }
}

#[test]
fn a_mirror_may_lead_elsewhere() {
    for program in programs() {
        let last = Mirror::serving(&[("images.gz", IMAGES), ("labels.gz", LABELS)]);
        let there = |name: &str| format!("{}/{name}", last.address);
        let [images, labels] = [there("images.gz"), there("labels.gz")];
        let first = Mirror::serving(&[
            ("images.gz", images.as_bytes()),
            ("labels.gz", labels.as_bytes()),
        ]);
        let folder = tempfile::tempdir().unwrap();
        fetch(program, &catalogue(&[&first]), &to(folder.path()), &()).unwrap();
        assert_eq!(names(folder.path()), ["images.gz", "labels.gz"]);
    }
}

#[test]
fn only_addresses_of_the_web_are_asked_for_and_none_is_an_option() {
    for program in programs() {
        let root = tempfile::tempdir().unwrap();
        std::fs::write(root.path().join("images.gz"), IMAGES).unwrap();
        let here = format!("file://{}", root.path().display());
        for mirror in [
            here.as_str(),
            "ftp://127.0.0.1",
            "-o/tmp",
            "--version",
            "127.0.0.1:1",
            "",
        ] {
            let folder = root.path().join("to");
            let options = FetchOptions {
                mirror: Some(mirror.to_string()),
                ..to(&folder)
            };
            let error = fetch(program, &catalogue(&[]), &options, &()).unwrap_err();
            let message = error.to_string();
            let FetchError::Mirrors { attempts, .. } = error else {
                panic!("{message}")
            };
            assert!(
                matches!(attempts[0].error, AttemptError::Address),
                "{message}"
            );
            assert!(
                message.contains("https://") && !folder.exists(),
                "{message}"
            );
        }
    }
}

/// What a server that sends the beginning of an answer, and then this without end, sees of a client:
/// whether it went before the server did.
fn client_leaves(listener: &TcpListener, endless: &[u8]) -> bool {
    let (mut stream, _) = listener.accept().unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(10)))
        .unwrap();
    let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
    while lines.next().is_some_and(|line| !line.unwrap().is_empty()) {}
    if endless.is_empty() {
        return stream.read(&mut [0]).is_ok_and(|read| read == 0);
    }
    stream
        .write_all(b"HTTP/1.1 200 OK\r\nConnection: close\r\n\r\n")
        .unwrap();
    (0..1_000_000).any(|_| stream.write_all(endless).is_err())
}

#[test]
fn a_file_without_end_is_not_read_to_its_end() {
    for program in programs() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let options = |folder: &Path| FetchOptions {
            mirror: Some(format!("http://{}", listener.local_addr().unwrap())),
            ..to(folder)
        };
        let folder = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            let server = scope.spawn(|| client_leaves(&listener, &[0; 1 << 16]));
            let error = fetch(program, &catalogue(&[]), &options(folder.path()), &()).unwrap_err();
            assert!(
                error.to_string().contains("expected 20 bytes, found more"),
                "{error}"
            );
            assert!(server.join().unwrap());
        });
    }
}

#[test]
fn a_download_that_is_stopped_leaves_no_folder_and_no_process() {
    for program in programs() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mirror = Some(format!("http://{}", listener.local_addr().unwrap()));
        let root = tempfile::tempdir().unwrap();
        let options = FetchOptions {
            mirror,
            ..to(&root.path().join("data/mnist"))
        };
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let server = scope.spawn(|| client_leaves(&listener, &[]));
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(500));
                stop.store(true, Ordering::Relaxed);
            });
            let ended = morphcog::data::fetch::fetch(
                &catalogue(&[]),
                &options,
                &[program],
                &Session::new(&stop, &()),
            );
            assert!(matches!(ended, Err(FetchError::Stopped(_))), "{ended:?}");
            assert!(server.join().unwrap(), "the program goes on");
        });
        assert!(names(root.path()).is_empty());
    }
}

#[test]
fn without_a_program_for_downloads_what_to_fetch_by_hand_is_said() {
    let sandbox = Sandbox::new();
    let mut command = sandbox.command(["data", "fetch"]);
    command.env("PATH", sandbox.path("nothing"));
    let said = said(command).ended(1, &["curl", "wget", "data/mnist yourself", "builtin"]);
    for remote in Catalogue::named("mnist").unwrap().files {
        assert!(said.err.contains(&format!(
            "https://ossci-datasets.s3.amazonaws.com/mnist/{}",
            remote.name
        )));
    }
    assert!(names(&sandbox.path("")).is_empty());

    // What is there needs no program.
    std::fs::create_dir(sandbox.path("own")).unwrap();
    std::fs::write(sandbox.path("own/images.gz"), IMAGES).unwrap();
    std::fs::write(sandbox.path("own/labels.gz"), LABELS).unwrap();
    let there = catalogue(&[]);
    let kept =
        morphcog::data::fetch::fetch(&there, &to(&sandbox.path("own")), &[], &Session::default());
    assert_eq!(outcomes(kept), [FetchOutcome::Kept, FetchOutcome::Kept]);
}

#[test]
fn settings_of_curl_do_not_send_a_file_elsewhere() {
    if !Program::Curl.is_installed() {
        return eprintln!("skipped: curl is not installed");
    }
    let sandbox = Sandbox::new();
    sandbox.write(".curlrc", "output = elsewhere\nhead\n");
    let mirror = Mirror::serving(&[("train-images-idx3-ubyte.gz", IMAGES)]);
    let mut command = sandbox.command(["data", "fetch", "--mirror", &mirror.address]);
    command
        .env("HOME", sandbox.path(""))
        .env("CURL_HOME", sandbox.path(""));
    said(command).ended(1, &["expected 9912422 bytes, found 20"]);
    assert_eq!(names(&sandbox.path("")), [".curlrc"]);
}
