//! The device that was at an address, found again after it was pulled out.

use super::address::{Address, BusKind};
use super::wire::open_stream;
use crate::error::{Error, ErrorKind};
use crate::port::BytePort;
use crate::port::inventory::{Machine, UsbFacts};

/// A device on a stream. One on USB that has a serial number is found by that wherever it is plugged in, and nothing else is
/// taken for it; any other is whatever is at its address.
#[derive(Clone, Debug)]
pub struct SameDevice {
    address: Address,
    baud_bps: u32,
    machine: Machine,
    /// What it says of itself, if that tells it apart.
    usb: Option<UsbFacts>,
    /// Where it is plugged in, if another device has the same number: then nothing else tells them apart.
    plug: Option<String>,
}

impl SameDevice {
    /// The device that is there now.
    #[must_use]
    pub fn at(address: &Address, baud_bps: u32) -> Self {
        Self::of(Machine::default(), address, baud_bps)
    }

    fn of(machine: Machine, address: &Address, baud_bps: u32) -> Self {
        let usb = match &address.bus {
            BusKind::Serial { path, .. } => machine.serial_port_at(path).and_then(|port| port.usb),
            _ => None,
        };
        let usb = usb.filter(|usb| usb.serial.is_some());
        let plug = usb.as_ref().filter(|usb| {
            let ports = machine.serial_ports().into_iter();
            ports.filter_map(|port| port.usb).filter(|of| is_same(of, usb)).count() > 1
        });
        let plug = plug.and_then(|usb| usb.plug.clone());
        Self { address: address.clone(), baud_bps, machine, usb, plug }
    }

    /// Opens it wherever it is now.
    ///
    /// # Errors
    /// It is not there, or cannot be opened.
    pub fn open(&self) -> Result<Box<dyn BytePort>, Error> {
        let absent = || Error::of(ErrorKind::Absent, "it is not plugged in");
        open_stream(&self.now_at().ok_or_else(absent)?, self.baud_bps)
    }

    /// Where it is now, if that is known.
    fn now_at(&self) -> Option<Address> {
        let (BusKind::Serial { path, .. }, Some(usb)) = (&self.address.bus, &self.usb) else {
            return Some(self.address.clone());
        };
        let is_same = |of: &Option<UsbFacts>| {
            let is_there = |of: &UsbFacts| self.plug.is_none() || of.plug == self.plug;
            of.as_ref().is_some_and(|of| is_same(of, usb) && is_there(of))
        };
        if self.machine.serial_port_at(path).is_some_and(|port| is_same(&port.usb)) {
            return Some(self.address.clone());
        }
        let ports = self.machine.serial_ports().into_iter();
        let mut others = ports.filter(|port| is_same(&port.usb));
        // Some devices all have the same number: those are found where they were, or not at all.
        let (Some(port), None) = (others.next(), others.next()) else { return None };
        let bus = match &self.address.bus {
            BusKind::Serial { baud_bps, .. } => {
                BusKind::Serial { path: port.path, baud_bps: *baud_bps }
            }
            other => other.clone(),
        };
        Some(Address { bus, ..self.address.clone() })
    }
}

/// True of two that say the same number, which some makers give to all.
fn is_same(one: &UsbFacts, other: &UsbFacts) -> bool {
    one.id == other.id && one.serial == other.serial
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;
    use std::path::{Path, PathBuf};

    /// A machine in a folder, as Linux shows one.
    struct Tree(PathBuf);

    impl Tree {
        fn new(name: &str) -> Self {
            let folder = format!("gaitway-same-{name}-{}", std::process::id());
            let root = std::env::temp_dir().join(folder);
            let _ = fs::remove_dir_all(&root);
            for folder in ["dev", "sys/class/tty"] {
                fs::create_dir_all(root.join(folder)).expect("a folder");
            }
            Self(root)
        }

        fn plug(&self, tty: &str, serial: Option<&str>) {
            self.plug_at(&format!("of-{tty}"), tty, serial);
        }

        fn plug_at(&self, place: &str, tty: &str, serial: Option<&str>) {
            let usb = self.0.join("sys/devices").join(place);
            fs::create_dir_all(usb.join(tty)).expect("a folder");
            let facts =
                [("idVendor", Some("1a86")), ("idProduct", Some("7523")), ("serial", serial)];
            for (name, text) in facts {
                let text = text.map(|text| fs::write(usb.join(name), text));
                assert!(text.is_none_or(|written| written.is_ok()));
            }
            let class = self.0.join(format!("sys/class/tty/{tty}"));
            fs::create_dir_all(&class).expect("a folder");
            symlink(usb.join(tty), class.join("device")).expect("a link");
            fs::write(self.0.join("dev").join(tty), "").expect("a node");
        }

        fn pull(&self, tty: &str) {
            let class = self.0.join(format!("sys/class/tty/{tty}"));
            if let Some(usb) =
                fs::canonicalize(class.join("device")).ok().as_deref().and_then(Path::parent)
            {
                let _ = fs::remove_dir_all(usb);
            }
            let _ = fs::remove_dir_all(class);
            let _ = fs::remove_file(self.0.join("dev").join(tty));
        }

        fn device(&self, tty: &str) -> SameDevice {
            let address = format!("/dev/{tty}?baud=9600").parse().expect("an address");
            SameDevice::of(Machine::at(Path::new(&self.0)), &address, 115_200)
        }
    }

    impl Drop for Tree {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn place(device: &SameDevice) -> Option<String> {
        device.now_at().map(|address| address.to_string())
    }

    #[test]
    fn a_device_with_a_serial_number_is_found_at_another_port_and_no_other_is_taken_for_it() {
        let tree = Tree::new("number");
        tree.plug("ttyTest7", Some("A1"));
        let device = tree.device("ttyTest7");
        let at = |tty: &str| Some(format!("serial:/dev/{tty}?baud=9600"));
        assert_eq!(place(&device), at("ttyTest7"));
        tree.pull("ttyTest7");
        assert_eq!(place(&device), None);
        tree.plug("ttyTest7", Some("B2"));
        assert_eq!(place(&device), None, "another one at the same port");
        tree.plug("ttyTest8", Some("A1"));
        assert_eq!(place(&device), at("ttyTest8"));
        tree.plug("ttyTest9", Some("A1"));
        assert_eq!(place(&device), None, "two that say that they are it");
        tree.pull("ttyTest7");
        tree.plug("ttyTest7", Some("A1"));
        assert_eq!(place(&device), at("ttyTest7"), "one of them is where it was");
    }

    #[test]
    fn of_two_devices_with_one_number_each_is_found_where_it_was_plugged_in() {
        let tree = Tree::new("twins");
        tree.plug_at("1-1", "ttyTest7", Some("0001"));
        tree.plug_at("1-2", "ttyTest8", Some("0001"));
        let devices = [tree.device("ttyTest7"), tree.device("ttyTest8")];
        let at = |tty: &str| Some(format!("serial:/dev/{tty}?baud=9600"));
        assert_eq!(devices.each_ref().map(place), [at("ttyTest7"), at("ttyTest8")]);
        tree.pull("ttyTest7");
        tree.pull("ttyTest8");
        assert_eq!(devices.each_ref().map(place), [None, None]);
        // The kernel names them as they come.
        tree.plug_at("1-2", "ttyTest7", Some("0001"));
        assert_eq!(devices.each_ref().map(place), [None, at("ttyTest7")]);
        tree.plug_at("1-1", "ttyTest8", Some("0001"));
        assert_eq!(devices.each_ref().map(place), [at("ttyTest8"), at("ttyTest7")]);
    }

    #[test]
    fn a_device_without_a_serial_number_is_whatever_is_at_its_port() {
        let tree = Tree::new("none");
        tree.plug("ttyTest7", None);
        let device = tree.device("ttyTest7");
        tree.pull("ttyTest7");
        tree.plug("ttyTest7", Some("B2"));
        assert_eq!(place(&device).as_deref(), Some("serial:/dev/ttyTest7?baud=9600"));
        assert_eq!(
            place(&tree.device("ttyTest9")).as_deref(),
            Some("serial:/dev/ttyTest9?baud=9600")
        );
    }
}
