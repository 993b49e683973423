//! The simulator and the page's service as a WebAssembly module.
//!
//! The page's worker asks for [`room`], writes a [`Call`] there as JSON, and lets the module
//! [`call`]; the answer lies at [`output`]. Addresses go over the boundary as numbers, and only the
//! worker reads and writes there, so nothing here is unsafe but the names of the functions.

#![allow(unsafe_code)] // `no_mangle` only: no other part of the module exports these names.

use morphcog::serve::local::Local;
use serde::Deserialize;
use std::cell::RefCell;

/// A request of the worker.
#[derive(Deserialize)]
#[serde(tag = "call", rename_all = "lowercase", deny_unknown_fields)]
enum Call {
    /// Offer these robots; the first call.
    Open { gallery: String },
    /// Answer a request of the page.
    Answer {
        method: String,
        target: String,
        body: String,
    },
    /// Begin a simulation: of a team, the members that have these numbers.
    Begin {
        target: String,
        body: String,
        #[serde(default)]
        members: Vec<usize>,
    },
    /// Simulate control steps.
    Advance { id: u64, due: u32 },
    /// Count a team's votes after these displacements, voxel lengths.
    Tally { id: u64, moved: Vec<Option<f64>> },
    /// Forget a simulation.
    End { id: u64 },
}

#[derive(Default)]
struct State {
    input: Vec<u8>,
    output: Vec<u8>,
    local: Option<Local>,
}

thread_local! {
    static STATE: RefCell<State> = RefCell::default();
}

/// Makes room for a call of `length` bytes, and returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn room(length: usize) -> usize {
    STATE.with_borrow_mut(|state| {
        state.input.clear();
        state.input.resize(length, 0);
        state.input.as_mut_ptr() as usize
    })
}

/// Does what the call in the room asks for. Returns an HTTP status; 400 and above come with one line
/// on what is wrong in place of the answer.
#[unsafe(no_mangle)]
pub extern "C" fn call() -> u32 {
    STATE.with_borrow_mut(|state| {
        let input = std::mem::take(&mut state.input);
        let (status, output) = match serde_json::from_slice(&input) {
            Ok(call) => answer(&mut state.local, call),
            Err(error) => (400, format!("call: {error}").into_bytes()),
        };
        state.output = output;
        u32::from(status)
    })
}

/// Returns the address of the last answer.
#[unsafe(no_mangle)]
pub extern "C" fn output() -> usize {
    STATE.with_borrow(|state| state.output.as_ptr() as usize)
}

/// Returns the length of the last answer, bytes.
#[unsafe(no_mangle)]
pub extern "C" fn output_length() -> usize {
    STATE.with_borrow(|state| state.output.len())
}

fn answer(local: &mut Option<Local>, call: Call) -> (u16, Vec<u8>) {
    let call = match call {
        Call::Open { gallery } => {
            return match Local::open(&gallery) {
                Ok(opened) => {
                    *local = Some(opened);
                    (204, Vec::new())
                }
                Err(error) => (500, error.to_string().into_bytes()),
            };
        }
        call => call,
    };
    let Some(local) = local else {
        return (500, b"open: expected as the first call".to_vec());
    };
    match call {
        Call::Open { .. } => (204, Vec::new()),
        Call::Answer {
            method,
            target,
            body,
        } => local.answer(&method, &target, body.as_bytes()),
        Call::Begin {
            target,
            body,
            members,
        } => match local.begin(&target, body.as_bytes(), &members) {
            Ok((_, event)) => (200, event.into_bytes()),
            Err(refusal) => refusal,
        },
        Call::Advance { id, due } => (200, local.advance(id, due).into_bytes()),
        Call::Tally { id, moved } => (200, local.tally(id, moved).into_bytes()),
        Call::End { id } => {
            local.end(id);
            (204, Vec::new())
        }
    }
}
