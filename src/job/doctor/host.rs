//! The checks of `doctor` that need no robot.

use crate::job::finding::Finding;
use crate::job::ports::{INSTALL_RULES, RULES, RULES_FILE};
use crate::port::inventory::Machine;
use rustix::process::{Resource, getrlimit};
use std::fs;

/// Where udev reads rules, strongest first.
const RULE_FOLDERS: [&str; 4] =
    ["etc/udev/rules.d", "run/udev/rules.d", "usr/local/lib/udev/rules.d", "usr/lib/udev/rules.d"];

/// Locked memory that a streaming process needs at most, bytes.
const LOCKED_BYTES: u64 = 64 * 1024 * 1024;

/// Whoever runs this process, as far as `doctor` cares.
#[derive(Clone, Debug)]
pub struct User {
    /// Name in `/etc/passwd`.
    pub name: String,
    /// User number.
    pub uid: u32,
    /// Groups this process is in.
    pub gids: Vec<u32>,
    /// Highest real-time priority it may ask for; `None`: no limit.
    pub rtprio: Option<u64>,
    /// Memory it may lock, bytes; `None`: no limit.
    pub memlock_bytes: Option<u64>,
}

impl User {
    /// Who runs this process on `machine`.
    #[must_use]
    pub fn current(machine: &Machine) -> Self {
        let uid = rustix::process::geteuid().as_raw();
        let passwd = fs::read_to_string(machine.file("etc/passwd")).unwrap_or_default();
        let name = passwd.lines().find_map(|line| {
            let mut fields = line.split(':');
            let name = fields.next()?;
            (fields.nth(1)?.parse() == Ok(uid)).then(|| name.to_owned())
        });
        let mut gids = vec![rustix::process::getegid().as_raw()];
        gids.extend(rustix::process::getgroups().unwrap_or_default().iter().map(|g| g.as_raw()));
        Self {
            name: name.unwrap_or_else(|| uid.to_string()),
            uid,
            gids,
            rtprio: getrlimit(Resource::Rtprio).current,
            memlock_bytes: getrlimit(Resource::Memlock).current,
        }
    }
}

/// Everything that can be said without a robot.
#[must_use]
pub fn findings(machine: &Machine, user: &User) -> Vec<Finding> {
    let rules = rules(machine);
    let installed = rules.remedy.is_none();
    let mut findings = vec![rules, group(machine, user)];
    findings.extend(modem_manager(machine, installed));
    findings.extend(brltty(machine));
    findings.extend([real_time(user), locked_memory(user)]);
    findings.extend(governor(machine));
    findings.push(can(machine));
    findings
}

/// Only who has a robot on CAN lines needs it.
fn can(machine: &Machine) -> Finding {
    let about = "CAN in the kernel";
    if machine.speaks_can() {
        return Finding::ok(about, "yes");
    }
    Finding::ok(
        about,
        "no; needed for CAN interfaces only: sudo modprobe can_raw, or a kernel with CONFIG_CAN. \
         can:slcan:PORT needs none",
    )
}

fn rules(machine: &Machine) -> Finding {
    let about = "udev rules";
    let path = |folder: &str| machine.file(&format!("{folder}/{RULES_FILE}"));
    let Some(found) = RULE_FOLDERS.iter().map(|f| path(f)).find(|path| path.is_file()) else {
        return Finding::advice(about, "not installed", INSTALL_RULES);
    };
    let text = fs::read_to_string(&found).unwrap_or_default();
    if text == RULES {
        Finding::ok(about, format!("installed: {}", found.display()))
    } else {
        let what = format!("{} differs from the rules of this version", found.display());
        Finding::advice(about, what, INSTALL_RULES)
    }
}

/// Membership of the group that serial ports belong to.
fn group(machine: &Machine, user: &User) -> Finding {
    let about = "group dialout";
    if user.uid == 0 {
        return Finding::advice(
            about,
            "you are root, who may do everything",
            "run gaitway as an ordinary user: nothing it does needs more",
        );
    }
    let Some(group) = machine.groups().into_iter().find(|group| group.name == "dialout") else {
        return Finding::ok(about, "this system has no such group; the udev rules give access");
    };
    if user.gids.contains(&group.gid) {
        return Finding::ok(about, format!("{} is a member", user.name));
    }
    if group.members.contains(&user.name) {
        return Finding::advice(
            about,
            format!("{} was added, but this session does not know it yet", user.name),
            "log out and in again",
        );
    }
    Finding::advice(
        about,
        format!("{} is not a member", user.name),
        format!(
            "only needed over SSH or without the udev rules: \
                 sudo usermod -aG dialout {}, then log in again",
            user.name
        ),
    )
}

fn modem_manager(machine: &Machine, rules_installed: bool) -> Option<Finding> {
    let runs = machine.processes().iter().any(|(_, name)| name == "ModemManager");
    let about = "ModemManager";
    match (runs, rules_installed) {
        (false, _) => None,
        (true, true) => Some(Finding::ok(about, "runs, and leaves servo adapters alone")),
        (true, false) => Some(Finding::problem(
            about,
            "runs, and talks to every new serial port for some seconds",
            INSTALL_RULES,
        )),
    }
}

/// The driver for Braille displays takes every CH340 for one.
fn brltty(machine: &Machine) -> Option<Finding> {
    let claims = |path: &std::path::PathBuf| {
        let text = fs::read_to_string(path).unwrap_or_default();
        let active = text.lines().filter(|line| !line.trim_start().starts_with('#'));
        active.map(str::to_lowercase).any(|line| line.contains("1a86") && line.contains("7523"))
    };
    let file = RULE_FOLDERS.iter().find_map(|folder| {
        let names = machine.names(folder).into_iter().filter(|name| name.contains("brltty"));
        names.map(|name| machine.file(&format!("{folder}/{name}"))).find(claims)
    })?;
    Some(Finding::problem(
        "brltty",
        format!("takes CH340 adapters away as soon as they are plugged in ({})", file.display()),
        "without a Braille display: sudo apt remove brltty; else comment out its line for 1a86:7523",
    ))
}

fn real_time(user: &User) -> Finding {
    let about = "real-time rights";
    match user.rtprio {
        _ if user.uid == 0 => Finding::ok(about, "yes, as root"),
        None => Finding::ok(about, "yes, any priority"),
        Some(priority) if priority > 0 => Finding::ok(about, format!("up to priority {priority}")),
        Some(_) => Finding::advice(
            about,
            "none; gaitway runs without, but other programs may make its cycles late",
            format!(
                "echo '{} - rtprio 60' | sudo tee /etc/security/limits.d/60-gaitway.conf\n\
                     log in again, then: chrt -f 50 gaitway play ...",
                user.name
            ),
        ),
    }
}

fn locked_memory(user: &User) -> Finding {
    let about = "locked memory";
    match user.memlock_bytes {
        _ if user.uid == 0 => Finding::ok(about, "no limit, as root"),
        None => Finding::ok(about, "no limit"),
        Some(bytes) if bytes >= LOCKED_BYTES => {
            Finding::ok(about, format!("up to {} MiB", bytes >> 20))
        }
        Some(bytes) => Finding::advice(
            about,
            format!("up to {} KiB; only matters on a machine that swaps", bytes >> 10),
            format!(
                "echo '{} - memlock {}' | sudo tee -a /etc/security/limits.d/60-gaitway.conf",
                user.name,
                LOCKED_BYTES >> 10
            ),
        ),
    }
}

fn governor(machine: &Machine) -> Option<Finding> {
    let about = "CPU governor";
    let folder = "sys/devices/system/cpu/cpu0/cpufreq";
    let governor = machine.line(&format!("{folder}/scaling_governor"))?;
    let driver = machine.line(&format!("{folder}/scaling_driver")).unwrap_or_default();
    // The powersave of these drivers goes up with the load; that of all others stays lowest.
    let scales_itself = driver.contains("pstate");
    Some(if governor == "powersave" && !scales_itself {
        Finding::advice(
            about,
            "powersave: the processor stays at its lowest speed",
            "sudo cpupower frequency-set -g schedutil   (or performance)",
        )
    } else {
        Finding::ok(about, governor)
    })
}
