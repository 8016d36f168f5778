//! What this machine offers: serial ports and CAN interfaces, who may open them, who holds them.
//!
//! Everything is read from files below one root, so that a test brings a tree of its own.

use super::can::{self, Controller};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Link layer type of CAN interfaces (`ARPHRD_CAN` in linux/if_arp.h).
const ARPHRD_CAN: &str = "280";

/// Name of the links that our own rules make.
const OWN_LINK: &str = "gaitway-";

/// A machine's files: `/`, or a test's folder.
#[derive(Clone, Debug)]
pub struct Machine {
    root: PathBuf,
}

/// A serial port that exists.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SerialPort {
    /// Device node, e.g. `/dev/ttyUSB0`; may be another one after the next plug-in.
    pub path: String,
    /// Names that stay: our rules' own first, then by serial number, then by place of the plug.
    pub stable_paths: Vec<String>,
    /// Kernel driver.
    pub driver: Option<String>,
    /// The USB device behind it, if it is one.
    pub usb: Option<UsbFacts>,
    /// Longest time the driver holds received bytes back, ms, where it says so (FTDI).
    pub latency_timer_ms: Option<u32>,
    /// Who may open it.
    pub access: Access,
    /// Programs that hold it open, as far as this user may see.
    pub held_by: Vec<Holder>,
}

/// What a USB device says of itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct UsbFacts {
    /// Vendor and product as `vvvv:pppp`.
    pub id: String,
    /// Product name.
    pub product: Option<String>,
    /// Maker's name.
    pub maker: Option<String>,
    /// Serial number; some have none, some all the same.
    pub serial: Option<String>,
    /// Where it is plugged in, as the kernel numbers the way there from the computer: `1-2.4`.
    #[serde(skip)]
    pub plug: Option<String>,
}

impl UsbFacts {
    /// Vendor and product id as numbers.
    #[must_use]
    pub fn ids(&self) -> Option<(u16, u16)> {
        let (vendor, product) = self.id.split_once(':')?;
        Some((u16::from_str_radix(vendor, 16).ok()?, u16::from_str_radix(product, 16).ok()?))
    }
}

/// Who may open a device node.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Access {
    /// True if this process may read and write it.
    pub granted: bool,
    /// Group it belongs to.
    pub group: String,
    /// Permission bits, octal.
    pub mode: String,
}

/// A program that holds a port.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Holder {
    /// Process ID.
    pub pid: u32,
    /// Its name.
    pub name: String,
}

/// A CAN interface of the kernel.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct CanPort {
    /// Interface, e.g. `can0`.
    pub name: String,
    /// What is behind it.
    pub kind: CanKind,
    /// `up` or `down`, as the kernel says.
    pub state: String,
    /// Kernel driver; none for a virtual one.
    pub driver: Option<String>,
    /// Line speed, bit/s; virtual interfaces have none.
    pub bitrate_bps: Option<u32>,
    /// Speed of the payload of fast FD frames, bit/s.
    pub data_bitrate_bps: Option<u32>,
    /// It carries CAN FD, if the kernel could be asked.
    pub fd: Option<bool>,
    /// Health of its controller, if it has one.
    pub controller: Option<Controller>,
    /// The USB device behind it, if it is one.
    pub usb: Option<UsbFacts>,
}

/// Kinds of CAN interfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CanKind {
    /// A controller with a driver of its own, on USB or built in.
    Controller,
    /// A serial adapter that `slcand` made an interface of.
    Slcan,
    /// None: frames go from program to program.
    Virtual,
}

impl Default for Machine {
    fn default() -> Self {
        Self::at("/")
    }
}

impl Machine {
    /// The machine whose files lie below `root`.
    #[must_use]
    pub fn at(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// The file called `path` (without leading slash) there.
    #[must_use]
    pub fn file(&self, path: &str) -> PathBuf {
        self.root.join(path)
    }

    /// The first line of a file, or nothing.
    #[must_use]
    pub fn line(&self, path: &str) -> Option<String> {
        first_line(&self.file(path))
    }

    /// Names in a folder, sorted; none if there is no such folder.
    #[must_use]
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.file(folder)).into_iter().flatten().flatten();
        let mut names: Vec<String> =
            entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names
    }

    /// Serial ports with hardware behind them, in order of name.
    #[must_use]
    pub fn serial_ports(&self) -> Vec<SerialPort> {
        let holders = self.holders();
        let names = self.names("sys/class/tty").into_iter();
        names.filter_map(|name| self.serial_port(&name, &holders)).collect()
    }

    fn serial_port(
        &self,
        name: &str,
        holders: &BTreeMap<String, Vec<Holder>>,
    ) -> Option<SerialPort> {
        let class = format!("sys/class/tty/{name}");
        let device = fs::canonicalize(self.file(&format!("{class}/device"))).ok()?;
        // The PC's driver registers ports that may not be soldered in: type 0 says that.
        if self.line(&format!("{class}/type")).as_deref() == Some("0") {
            return None;
        }
        let path = format!("/dev/{name}");
        let node = self.file(&format!("dev/{name}"));
        let access = self.access(&node)?;
        let timer = self.line(&format!("{class}/device/latency_timer"));
        Some(SerialPort {
            stable_paths: self.stable_paths(&node),
            driver: driver_of(&device),
            usb: usb_above(&device),
            latency_timer_ms: timer.and_then(|text| text.parse().ok()),
            access,
            held_by: holders.get(&path).cloned().unwrap_or_default(),
            path,
        })
    }

    fn access(&self, node: &Path) -> Option<Access> {
        let facts = fs::metadata(node).ok()?;
        let wanted = rustix::fs::Access::READ_OK | rustix::fs::Access::WRITE_OK;
        Some(Access {
            granted: rustix::fs::access(node, wanted).is_ok(),
            group: self.group_name(facts.gid()),
            mode: format!("{:04o}", facts.permissions().mode() & 0o7777),
        })
    }

    /// The serial port behind `path`, which may be a link to it.
    #[must_use]
    pub fn serial_port_at(&self, path: &str) -> Option<SerialPort> {
        let node = fs::canonicalize(path).unwrap_or_else(|_| path.into());
        self.serial_ports().into_iter().find(|port| node == Path::new(&port.path))
    }

    /// The name of a group, or its number.
    #[must_use]
    pub fn group_name(&self, gid: u32) -> String {
        let named = self.groups().into_iter().find(|group| group.gid == gid);
        named.map_or_else(|| gid.to_string(), |group| group.name)
    }

    /// The groups of `/etc/group`.
    #[must_use]
    pub fn groups(&self) -> Vec<Group> {
        let text = fs::read_to_string(self.file("etc/group")).unwrap_or_default();
        text.lines().filter_map(Group::read).collect()
    }

    fn stable_paths(&self, node: &Path) -> Vec<String> {
        let Ok(real) = fs::canonicalize(node) else { return Vec::new() };
        let leads_here =
            |path: &String| fs::canonicalize(self.file(path)).is_ok_and(|to| to == real);
        let own = self.names("dev").into_iter().filter(|name| name.starts_with(OWN_LINK));
        let own = own.map(|name| format!("dev/{name}"));
        let given = ["dev/serial/by-id", "dev/serial/by-path"].into_iter().flat_map(|folder| {
            self.names(folder).into_iter().map(move |name| format!("{folder}/{name}"))
        });
        own.chain(given).filter(leads_here).map(|path| format!("/{path}")).collect()
    }

    /// Programs by the device they hold open; only those this user may look into.
    fn holders(&self) -> BTreeMap<String, Vec<Holder>> {
        let mut holders: BTreeMap<String, Vec<Holder>> = BTreeMap::new();
        for (pid, name) in self.processes() {
            let mut held: Vec<String> = self
                .names(&format!("proc/{pid}/fd"))
                .iter()
                .filter_map(|fd| fs::read_link(self.file(&format!("proc/{pid}/fd/{fd}"))).ok())
                .filter_map(|path| path.to_str().map(str::to_owned))
                .filter(|path| path.starts_with("/dev/tty"))
                .collect();
            held.sort();
            held.dedup();
            for path in held {
                holders.entry(path).or_default().push(Holder { pid, name: name.clone() });
            }
        }
        holders
    }

    /// Running programs by process ID.
    #[must_use]
    pub fn processes(&self) -> Vec<(u32, String)> {
        let pids = self.names("proc").into_iter().filter_map(|name| name.parse::<u32>().ok());
        pids.filter_map(|pid| Some((pid, self.line(&format!("proc/{pid}/comm"))?))).collect()
    }

    /// CAN interfaces, in order of name.
    #[must_use]
    pub fn can_ports(&self) -> Vec<CanPort> {
        let is_can = |name: &String| {
            self.line(&format!("sys/class/net/{name}/type")).as_deref() == Some(ARPHRD_CAN)
        };
        let names = self.names("sys/class/net").into_iter().filter(is_can);
        names.map(|name| self.can_port(name)).collect()
    }

    /// True if this kernel knows CAN lines, as far as that can be seen.
    #[must_use]
    pub fn speaks_can(&self) -> bool {
        !self.is_this_one() || can::is_supported()
    }

    /// What the kernel tells over netlink is told of this machine only.
    fn is_this_one(&self) -> bool {
        self.root == Path::new("/")
    }

    fn can_port(&self, name: String) -> CanPort {
        let class = format!("sys/class/net/{name}");
        let device = fs::canonicalize(self.file(&format!("{class}/device"))).ok();
        let asked = self.is_this_one().then(|| can::state(&name).ok()).flatten();
        let state = match asked {
            Some(asked) => Some(if asked.up { "up" } else { "down" }.to_owned()),
            None => self.line(&format!("{class}/operstate")),
        };
        let bitrate_bps = asked.and_then(|asked| asked.bitrate_bps);
        // slcand gives any name; its interfaces have a health, virtual ones have none.
        let healthy = asked.is_some_and(|asked| asked.controller.is_some());
        let kind = if name.starts_with("slcan") || device.is_none() && healthy {
            CanKind::Slcan
        } else if name.starts_with("vcan") || device.is_none() && asked.is_some() {
            CanKind::Virtual
        } else {
            CanKind::Controller
        };
        CanPort {
            kind,
            state: state.unwrap_or_else(|| "unknown".to_owned()),
            driver: device.as_ref().and_then(|device| link_name(&device.join("driver"))),
            usb: device.as_deref().and_then(usb_above),
            bitrate_bps,
            data_bitrate_bps: asked.and_then(|asked| asked.data_bitrate_bps),
            fd: asked.map(|asked| asked.fd),
            controller: asked.and_then(|asked| asked.controller),
            name,
        }
    }
}

/// A line of `/etc/group`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// Its number.
    pub gid: u32,
    /// Users listed as members.
    pub members: Vec<String>,
}

impl Group {
    fn read(line: &str) -> Option<Self> {
        let mut fields = line.split(':');
        let (name, _password) = (fields.next()?, fields.next()?);
        let gid = fields.next()?.parse().ok()?;
        let members = fields.next().unwrap_or_default().split(',').filter(|m| !m.is_empty());
        Some(Self { name: name.to_owned(), gid, members: members.map(str::to_owned).collect() })
    }
}

fn first_line(path: &Path) -> Option<String> {
    let text = fs::read_to_string(path).ok()?;
    text.lines().next().map(|line| line.trim().to_owned()).filter(|line| !line.is_empty())
}

/// The last part of where a link leads.
fn link_name(link: &Path) -> Option<String> {
    fs::canonicalize(link).ok()?.file_name()?.to_str().map(str::to_owned)
}

/// The driver of a port. A built-in port hangs on two devices of the kernel's own making, which
/// say nothing of the hardware.
fn driver_of(device: &Path) -> Option<String> {
    let drivers = device.ancestors().filter_map(|folder| link_name(&folder.join("driver")));
    drivers.into_iter().find(|name| !matches!(name.as_str(), "port" | "ctrl"))
}

/// The USB device that `device` is a part of.
fn usb_above(device: &Path) -> Option<UsbFacts> {
    let usb = device.ancestors().find(|folder| folder.join("idVendor").is_file())?;
    let said = |name: &str| first_line(&usb.join(name));
    Some(UsbFacts {
        id: format!("{}:{}", said("idVendor")?, said("idProduct")?).to_lowercase(),
        product: said("product"),
        maker: said("manufacturer"),
        serial: said("serial"),
        plug: usb.file_name().and_then(|name| name.to_str()).map(str::to_owned),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_line_is_read_with_its_members_and_nonsense_is_not() {
        let group = Group::read("dialout:x:20:ada,grace").expect("a group");
        assert_eq!((group.name.as_str(), group.gid), ("dialout", 20));
        assert_eq!(group.members, ["ada", "grace"]);
        assert_eq!(Group::read("dialout:x:20:").expect("a group").members.len(), 0);
        assert_eq!(Group::read("dialout:x"), None);
        assert_eq!(Group::read("dialout:x:many:"), None);
    }

    #[test]
    fn usb_ids_are_numbers_or_nothing() {
        let usb = |id: &str| UsbFacts {
            id: id.into(),
            product: None,
            maker: None,
            serial: None,
            plug: None,
        };
        assert_eq!(usb("0403:6014").ids(), Some((0x0403, 0x6014)));
        assert_eq!(usb("0403").ids(), None);
        assert_eq!(usb("zzzz:6014").ids(), None);
    }
}
