//! Control Table Backup and Startup Configuration of DYNAMIXEL 2.0.
//!
//! e-Manual, Protocol 2.0, "Control Table Backup(0x20)": all of EEPROM, the gains, the profile and
//! the indirect addresses are kept; torque must be off; restoring restarts the servo. Startup
//! Configuration(60): bit 0 brings the torque on at power-up (the manual's table has on and off
//! exchanged; the name of the bit is followed), bit 1 lays the kept RAM values over the defaults.
//!
//! The manual does not say what becomes of the kept RAM values when a backup is restored without
//! bit 1: the restart that belongs to the restoring loads them, later ones do not.

use super::{BOOT_NS, Refusal, Servo};
use gaitway_profiles::{Region, Role};
use std::sync::Arc;

const STARTUP_TORQUE_ON: i64 = 0x01;
const STARTUP_RAM_RESTORE: i64 = 0x02;
/// What a backup keeps of RAM.
const KEPT_RAM: [Role; 10] = [
    Role::VelocityIGain,
    Role::VelocityPGain,
    Role::PositionDGain,
    Role::PositionIGain,
    Role::PositionPGain,
    Role::Feedforward1stGain,
    Role::Feedforward2ndGain,
    Role::ProfileAcceleration,
    Role::ProfileVelocity,
    Role::IndirectAddress,
];

impl Servo {
    /// Keeps the control table as it is now.
    pub fn backup_store(&mut self, now_ns: u64) -> Result<(), Refusal> {
        self.backup_allowed(now_ns)?;
        self.backup = Some(self.table.clone());
        Ok(())
    }

    /// Brings the kept control table back, then restarts.
    pub fn backup_restore(&mut self, now_ns: u64) -> Result<(), Refusal> {
        self.backup_allowed(now_ns)?;
        let kept = self.backup.clone().ok_or(Refusal::Failed)?;
        self.events.push(super::Event::Eeprom { address: 0 });
        let model = Arc::clone(&self.model);
        for item in model.items.iter().filter(|item| item.region == Region::Eeprom) {
            self.persistent[item.range()].copy_from_slice(&kept[item.range()]);
        }
        self.restart(now_ns, now_ns + BOOT_NS);
        self.load_kept_ram();
        Ok(())
    }

    fn backup_allowed(&mut self, now_ns: u64) -> Result<(), Refusal> {
        self.advance(now_ns);
        let from = self.model.profile.backup_from_firmware.ok_or(Refusal::Instruction)?;
        if self.firmware() < from {
            return Err(Refusal::Instruction);
        }
        if self.torque_on() { Err(Refusal::Failed) } else { Ok(()) }
    }

    fn load_kept_ram(&mut self) {
        let Some(kept) = &self.backup else { return };
        for item in &self.model.items {
            let in_ram = item.region == Region::Ram;
            if in_ram && item.role.is_some_and(|role| KEPT_RAM.contains(&role)) {
                self.table[item.range()].copy_from_slice(&kept[item.range()]);
            }
        }
        self.update_regulator();
    }

    /// What Startup Configuration(60) asks for once the rest of the table stands.
    pub(super) fn start_up(&mut self) {
        let wishes = self.value(Role::StartupConfiguration).unwrap_or(0);
        if wishes & STARTUP_RAM_RESTORE != 0 {
            self.load_kept_ram();
        }
        if wishes & STARTUP_TORQUE_ON != 0 {
            self.put(Role::TorqueEnable, 1);
            self.follow_torque();
        }
    }
}
