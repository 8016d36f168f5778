//! What a page holds, read back by nothing that wrote it: `src/view/series.rs` says how numbers are kept.

#![allow(dead_code, reason = "each test file uses a part")]

use serde_json::Value;

/// The data of a page.
pub fn data(html: &str) -> Value {
    let after = html.split("<script type=\"application/json\" id=\"data\">").nth(1).expect("data");
    serde_json::from_str(after.split("</script>").next().unwrap()).expect("JSON")
}

/// A series; gaps are not a number.
pub fn series(of: &Value) -> Vec<f64> {
    let digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let number = |key: &str| of[key].as_f64().unwrap_or_else(|| panic!("{key} in {of}"));
    let text = of["bits"].as_str().expect("bits");
    let digit = |c: char| digits.find(c).unwrap_or(0);
    let mut bits = text.chars().flat_map(|c| (0..6).rev().map(move |bit| digit(c) >> bit & 1 == 1));
    let count = number("count") as usize;
    let mut changes: Vec<i64> = Vec::new();
    while changes.len() < count {
        let mut whole = |count: u64| {
            (0..count).fold(0_i64, |value, _| value << 1 | i64::from(bits.next().expect("a bit")))
        };
        let k = whole(5) as u64;
        for _ in 0..(count - changes.len()).min(32) {
            if k == 31 {
                changes.push(0);
                continue;
            }
            let mut ones = 0_i64;
            while bits.next().expect("a bit") {
                ones += 1;
            }
            let low = (0..k).fold(0, |v, _| v << 1 | i64::from(bits.next().expect("a bit")));
            let code = ones << k | low;
            changes.push(if code % 2 == 1 { -(code + 1) / 2 } else { code / 2 });
        }
    }
    for _ in 0..number("order") as usize {
        let mut sum = 0;
        for change in &mut changes {
            sum += *change;
            *change = sum;
        }
    }
    let (start, step) = (number("start"), number("step"));
    let mut values: Vec<f64> = changes.iter().map(|x| start + step * *x as f64).collect();
    for gap in of["gaps"].as_array().into_iter().flatten() {
        let [from, length] = [0, 1].map(|at| gap[at].as_u64().expect("a number") as usize);
        values[from..from + length].fill(f64::NAN);
    }
    values
}

/// Series side by side.
pub fn rows<const N: usize>(of: &Value) -> Vec<[f64; N]> {
    let columns: Vec<Vec<f64>> = (0..N).map(|at| series(&of[at])).collect();
    (0..columns[0].len()).map(|row| std::array::from_fn(|at| columns[at][row])).collect()
}
