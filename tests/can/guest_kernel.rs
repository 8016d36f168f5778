//! Boots user-mode Linux with this machine's files as its own, read only, and runs the ignored
//! tests of this program in it.

use std::fs;
use std::io::Read as _;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

/// The guest boots in two seconds; a machine that is busy with other tests may take its time.
const PATIENCE: Duration = Duration::from_secs(180);

/// The guest kernel does not keep these registers for its programs; see `fxsave_only.py`. The last
/// one is a preference that glibc derives from AVX2 before it hears that there is none, and that
/// decides by itself how memory is copied: wrongly, when a page has to be fetched in between.
const NO_AVX: &str =
    "glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX512BW,-AVX2,-AVX,-AVX_Fast_Unaligned_Load";

/// What became of the suite.
pub enum Outcome {
    /// All is well; what was printed.
    Passed(String),
    /// Some test failed; what was printed.
    Failed(String),
    /// Why there was no guest.
    NotStarted(String),
}

pub fn run_suite() -> Outcome {
    let command = match prepare() {
        Ok(command) => command,
        Err(why) => return Outcome::NotStarted(why),
    };
    let said = match watch(command) {
        Ok(said) => said,
        Err(why) => return Outcome::NotStarted(why),
    };
    if said.contains("GUEST-RESULT 0") {
        Outcome::Passed(said)
    } else if said.contains("GUEST-READY") {
        Outcome::Failed(said)
    } else {
        Outcome::NotStarted(format!("it said:\n{said}"))
    }
}

fn prepare() -> Result<Command, String> {
    let kernel = find("linux.uml").ok_or("linux.uml is not installed")?;
    let busybox = find("busybox").ok_or("busybox is not installed")?;
    find("slcand").ok_or("slcand is not installed")?;
    let tests = std::env::current_exe().map_err(|e| e.to_string())?;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("can-guest");
    fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    let init = folder.join("init.sh");
    fs::write(&init, script(&busybox, &tests)).map_err(|e| e.to_string())?;
    fs::set_permissions(&init, fs::Permissions::from_mode(0o755)).map_err(|e| e.to_string())?;
    let init = init.to_str().filter(|path| !path.contains(' '));
    let init = init.ok_or("the kernel cannot be told a path with spaces")?;
    let mut command = Command::new(find("python3").ok_or("python3 is not installed")?);
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/can/fxsave_only.py"));
    command.arg(kernel).args([
        "mem=192M",
        "root=/dev/root",
        "rootfstype=hostfs",
        "rootflags=/",
        "ro",
    ]);
    command.arg(format!("init={init}"));
    command.arg(format!("GLIBC_TUNABLES={NO_AVX}"));
    // Console on what was given as input and output; "con=null" for the other consoles.
    command.args(["con=null", "con0=fd:0,fd:1", "ssl=null", "quiet", "loglevel=3"]);
    command.env("HOME", &folder); // where it keeps its sockets
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    command.process_group(0);
    Ok(command)
}

fn find(program: &str) -> Option<PathBuf> {
    let path = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin:/usr/bin:/sbin:/bin";
    path.split(':').map(|folder| Path::new(folder).join(program)).find(|file| file.is_file())
}

/// What the guest does first and last.
fn script(busybox: &Path, tests: &Path) -> String {
    format!(
        r#"#!/bin/sh
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
B='{busybox}'
$B mount -t proc proc /proc
$B mount -t sysfs sys /sys
$B mount -t tmpfs tmp /run
$B mkdir -p /dev/pts /dev/shm
$B mount -t devpts -o ptmxmode=666 devpts /dev/pts
K=/usr/lib/uml/modules/$($B uname -r)/kernel
for module in drivers/net/can/dev/can-dev net/can/can net/can/can-raw \
              drivers/net/can/vcan drivers/net/can/slcan/slcan; do
    $B insmod $K/$module.ko || echo "module $module is missing"
done
for k in 0 1 2; do $B ip link add dev vcan$k type vcan; done
$B ip link set vcan0 mtu 72 && $B ip link set vcan0 up
$B ip link set vcan1 mtu 16 && $B ip link set vcan1 up
$B ip link set vcan2 mtu 72
export TMPDIR=/run HOME=/run RUST_BACKTRACE=0
echo GUEST-READY
'{tests}' --ignored --nocapture --test-threads=1 guest:: 2>&1
echo "GUEST-RESULT $?"
$B poweroff -f
"#,
        busybox = busybox.display(),
        tests = tests.display()
    )
}

/// Runs it to its end, or ends it when it takes too long.
fn watch(mut command: Command) -> Result<String, String> {
    let mut guest = command.spawn().map_err(|e| format!("{command:?}: {e}"))?;
    let mut output = guest.stdout.take().ok_or("no output")?;
    let (done, ended) = mpsc::channel();
    let reader = std::thread::spawn(move || {
        let mut said = Vec::new();
        let _ = output.read_to_end(&mut said);
        let _ = done.send(());
        String::from_utf8_lossy(&said).into_owned()
    });
    let in_time = ended.recv_timeout(PATIENCE).is_ok();
    if !in_time && let Some(group) = i32::try_from(guest.id()).ok().and_then(pid) {
        // Its processes are its own group; all of them, or the pipe stays open.
        let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
    }
    let _ = guest.wait();
    let said = reader.join().map_err(|_| "its output could not be read")?;
    Ok(if in_time { said } else { format!("{said}\n(ended after {PATIENCE:?})") })
}

fn pid(number: i32) -> Option<rustix::process::Pid> {
    rustix::process::Pid::from_raw(number)
}
