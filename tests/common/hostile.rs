//! Deliberately broken inputs: a small mutator, deterministic by its seed.

use serde_json::{Map, Value};

/// A simple stream of random numbers (splitmix64).
pub struct Dice(u64);

impl Dice {
    pub fn new(kind: usize, number: u64) -> Self {
        Dice(
            (kind as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
                ^ number.wrapping_mul(0xd134_2543_de82_ef95),
        )
    }

    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a number below `most`, which is above 0.
    pub fn below(&mut self, most: usize) -> usize {
        (self.next() % most as u64) as usize
    }

    pub fn pick<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        &of[self.below(of.len())]
    }
}

/// Characters that control terminals, forge lines or reverse the direction of writing.
pub const EVIL: &str = "\u{1b}[2J\u{1b}]0;x\u{7}\nerror: forged\r\u{9b}31m\u{202e}\u{0}";

const PIECES: [&str; 24] = [
    "null",
    "true",
    "-1",
    "0",
    "1e999",
    "-1e308",
    "1e-320",
    "NaN",
    "18446744073709551616",
    "4294967296",
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    "\"",
    "\\u0000",
    "\\ud800",
    "\u{1b}[31m",
    "\u{202e}",
    "[[[[[[[[",
    "0.1e",
    "\u{feff}",
];

/// Damages a text in one to four places, ignoring its structure.
pub fn bytes(dice: &mut Dice, text: &[u8]) -> Vec<u8> {
    let mut text = text.to_vec();
    for _ in 0..=dice.below(4) {
        if text.is_empty() {
            break;
        }
        let at = dice.below(text.len());
        let end = (at + 1 + dice.below(40)).min(text.len());
        match dice.below(8) {
            0 => text[at] ^= 1 << dice.below(8),
            1 => text[at] = *dice.pick(b"0123456789-.eE+[]{},:\"\\ \n\0\xff\x80\x1b"),
            2 => drop(text.drain(at..end)),
            3 => {
                let piece = text[at..end].to_vec();
                let to = dice.below(text.len());
                text.splice(to..to, piece);
            }
            4 => text.truncate(at),
            5 => {
                let piece = text[at..end].to_vec();
                let times = 1 + dice.below(200);
                text.splice(at..at, piece.repeat(times));
            }
            _ => {
                let piece = dice.pick(&PIECES).as_bytes().to_vec();
                text.splice(at..at, piece);
            }
        }
    }
    text
}

/// Changes one to three parts of a value, half of the time only leaves, which readers may accept.
pub fn value(dice: &mut Dice, value: &Value) -> Value {
    let mut value = value.clone();
    if dice.below(2) == 0 {
        for _ in 0..=dice.below(2) {
            gently(dice, &mut value);
        }
        return value;
    }
    for _ in 0..=dice.below(3) {
        let count = nodes(&value);
        let mut place = place(dice, count);
        change(dice, node(&mut value, &mut place));
    }
    value
}

fn place(dice: &mut Dice, count: usize) -> usize {
    // Often near the root, where the important keys are.
    if dice.below(2) == 0 {
        dice.below(count)
    } else {
        dice.below(count.min(60))
    }
}

/// Changes one number, text or truth value in a value.
fn gently(dice: &mut Dice, value: &mut Value) {
    let count = nodes(value);
    for _ in 0..100 {
        let mut place = place(dice, count);
        let found = node(value, &mut place);
        match found {
            Value::Number(number) => {
                let factor = *dice.pick(&[0.0, 0.1, 0.5, 2.0, 10.0, 1e3, 1e6, 1e9, 1e15, -1.0]);
                let changed = match number.as_i64() {
                    Some(whole) if dice.below(2) == 0 => {
                        Value::from(whole.saturating_add(*dice.pick(&[-1, 1, 7])))
                    }
                    Some(whole) => Value::from((whole as f64 * factor) as i64),
                    None => Value::from(
                        number.as_f64().unwrap_or(1.0)
                            * factor
                            * *dice.pick(&[1.0, 1e-9, 1.0000001]),
                    ),
                };
                return *found = changed;
            }
            Value::String(text) => return text.push_str(EVIL),
            Value::Bool(truth) => return *truth = !*truth,
            _ => {}
        }
    }
}

fn nodes(value: &Value) -> usize {
    1 + match value {
        Value::Array(list) => list.iter().map(nodes).sum(),
        Value::Object(map) => map.values().map(nodes).sum::<usize>(),
        _ => 0,
    }
}

/// Returns the node of a number, counted breadth first, so that nodes near the root are first.
fn node<'v>(root: &'v mut Value, number: &mut usize) -> &'v mut Value {
    let mut level = vec![root];
    loop {
        if *number < level.len() {
            return level.swap_remove(*number);
        }
        *number -= level.len();
        let mut next = Vec::new();
        for value in level {
            match value {
                Value::Array(list) => next.extend(list.iter_mut()),
                Value::Object(map) => next.extend(map.values_mut()),
                _ => {}
            }
        }
        level = next;
    }
}

fn change(dice: &mut Dice, value: &mut Value) {
    let deep = |dice: &mut Dice| {
        (0..1 + dice.below(300)).fold(Value::from(1), |inner, _| Value::from(vec![inner]))
    };
    match dice.below(10) {
        0..=4 => {}
        5 => return *value = any(dice),
        6 => return *value = deep(dice),
        7 => return *value = Value::from(vec![value.clone(); dice.below(50)]),
        8 => return *value = Value::from(EVIL),
        _ => return *value = Value::Null,
    }
    match value {
        Value::Number(number) => {
            let number = number.as_f64().unwrap_or(0.0);
            *value = match dice.below(9) {
                0 => Value::from(-number),
                1 => Value::from(number + 1.0),
                2 => Value::from(number as i64 + 1),
                3 => Value::from((number as i64).saturating_sub(1)),
                4 => Value::from(number * 1e6),
                5 => Value::from((number as u64).saturating_mul(1000)),
                6 => Value::from(number * 1e-9),
                _ => any(dice),
            }
        }
        Value::String(text) => match dice.below(5) {
            0 => text.push_str(EVIL),
            1 => text.clear(),
            2 => *text = text.repeat(1 + dice.below(3000)),
            3 => *text = String::from_utf8_lossy(&bytes(dice, text.as_bytes())).into_owned(),
            _ => *value = any(dice),
        },
        Value::Array(list) if !list.is_empty() => {
            let at = dice.below(list.len());
            match dice.below(6) {
                0 => drop(list.remove(at)),
                1 => list.insert(at, list[at].clone()),
                2 => list.truncate(at),
                3 => list.reverse(),
                4 => list.push(any(dice)),
                _ => {
                    let all = list.clone();
                    (0..dice.below(8)).for_each(|_| list.extend(all.iter().cloned()));
                }
            }
        }
        Value::Object(map) if !map.is_empty() => {
            let keys: Vec<String> = map.keys().cloned().collect();
            let key = dice.pick(&keys).clone();
            match dice.below(5) {
                0 => drop(map.remove(&key)),
                1 => drop(map.insert(format!("{key}{EVIL}"), any(dice))),
                2 => drop(map.insert("k".repeat(1 + dice.below(5000)), any(dice))),
                3 => {
                    let (a, b) = (map[&key].clone(), dice.pick(&keys).clone());
                    map.insert(b, a);
                }
                _ => drop(map.insert(key, any(dice))),
            }
        }
        other => *other = any(dice),
    }
}

fn any(dice: &mut Dice) -> Value {
    match dice.below(16) {
        0 => Value::Null,
        1 => Value::from(dice.below(2) == 0),
        2 => Value::from(0),
        3 => Value::from(-1),
        4 => Value::from(u64::MAX),
        5 => Value::from(i64::MIN),
        6 => Value::from(1e308),
        7 => Value::from(-1e-320),
        8 => Value::from(4_294_967_296_u64),
        9 => Value::from(dice.below(1 << 24)),
        10 => Value::from(""),
        11 => Value::from(EVIL),
        12 => Value::from("x".repeat(20_000)),
        13 => Value::from(Vec::<Value>::new()),
        14 => Value::Object(Map::new()),
        _ => Value::from(vec![0.5; dice.below(3000)]),
    }
}
