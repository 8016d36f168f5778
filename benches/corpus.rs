//! A labelled corpus of N trials (5,000 unless told): how fast it is made, what it takes, and what three
//! usual queries take in DuckDB, against the same rows written again by PyArrow with its own zstd:
//! `cargo bench --bench corpus -- 100000`. It needs duckdb and pyarrow for `python3`, or for the
//! interpreter that `PYTHON` names.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const CLASSES: [(&str, &str); 5] = [
    ("walking", "walk"),
    ("running", "run"),
    ("boxing", "box-l"),
    ("bowing", "bow"),
    ("waving", "wave-r"),
];

const QUERIES: &str = r#"
import glob, os, shutil, sys, time
import duckdb, pyarrow.parquet as pq

folder = sys.argv[1]
other = folder + "-pyarrow"
shutil.rmtree(other, ignore_errors=True)
os.makedirs(other)
ours, theirs = 0, 0
for path in sorted(glob.glob(folder + "/poses-*.parquet")):
    table = pq.read_table(path)
    words = ["variation", "label", "class", "subject", "time_s"]
    split = [f.name for f in table.schema if str(f.type) == "float" and f.name not in words]
    again = os.path.join(other, os.path.basename(path))
    pq.write_table(table, again, compression="zstd", use_dictionary=words, use_byte_stream_split=split)
    ours += os.path.getsize(path)
    theirs += os.path.getsize(again)
print(f"poses: {ours / 1e6:.1f} MB, by PyArrow {theirs / 1e6:.1f} MB: {ours / theirs:.2f}")
one = int(sys.argv[2]) // 2
queries = [
    ("poses by class", "select label, count(*), count(distinct variation) from '{}' group by all"),
    ("one variation, whole", f"select * from '{{}}' where label = 'running' and variation = {one}"),
    ("deepest knee bend of each", "select label, variation, max(right_knee_flexion_rad) from '{}' group by all"),
]
for name, query in queries:
    took = []
    for at in [folder, other]:
        times = []
        for _ in range(5):
            begin = time.perf_counter()
            duckdb.sql(query.format(at + "/poses-*.parquet")).fetchnumpy()
            times.append(time.perf_counter() - begin)
        took.append(sorted(times)[2])
    print(f"{name}: {took[0] * 1e3:.0f} ms, by PyArrow's files {took[1] * 1e3:.0f} ms: {took[0] / took[1]:.2f}")
shutil.rmtree(other)
"#;

fn bytes_in(folder: &Path, table: &str) -> u64 {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry"));
    let of = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(table));
    of.map(|entry| entry.metadata().expect("a file").len()).sum()
}

fn main() {
    let trials = std::env::args().filter_map(|word| word.parse::<u32>().ok()).next();
    let each = trials.unwrap_or(5_000) / CLASSES.len() as u32;
    let trials = f64::from(each) * CLASSES.len() as f64;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("corpus-bench");
    let _ = fs::remove_dir_all(&folder);
    let mut command = Command::new(env!("CARGO_BIN_EXE_gaitway"));
    command.args(["synth", "--variations", &each.to_string(), "--json", "-o"]).arg(&folder);
    for (label, action) in CLASSES {
        command.args(["--class", &format!("{label}={action}")]);
    }
    let begin = Instant::now();
    let output = command.output().expect("the program");
    let took_s = begin.elapsed().as_secs_f64();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a report");
    let poses = report["poses"].as_f64().expect("poses");
    println!(
        "{trials} trials of {} classes, {poses:.3e} poses at 120 Hz: {took_s:.1} s, {:.0} trials/s, \
         {:.0} poses/s",
        CLASSES.len(),
        trials / took_s,
        poses / took_s
    );
    for table in ["poses", "actionlets", "variations"] {
        let bytes = bytes_in(&folder, table) as f64;
        println!("{table}: {:.0} bytes a trial, {:.1} a pose", bytes / trials, bytes / poses);
    }
    let python = std::env::var("PYTHON").unwrap_or("python3".to_owned());
    let script = ["-c", QUERIES, &folder.display().to_string(), &each.to_string()];
    match Command::new(python).args(script).status() {
        Ok(status) if status.success() => {}
        _ => println!("SKIPPED: no Python with duckdb and pyarrow"),
    }
    let _ = fs::remove_dir_all(&folder);
}
