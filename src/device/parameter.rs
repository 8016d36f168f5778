//! The numbered settings of CAN actuators: what each is called, what its number means in SI units,
//! and whether it is a setting at all or a goal in the guise of one.
//!
//! Source: Damiao: cmjang/DM_Control_Python, `DM_CAN.py`, and jia-xie/damiao-motor 1.0.6, its
//! register table. RobStride: Xiaomi, "CyberGear instruction manual", section 4.1.14
//! (belovictor/cybergear-docs); RobStride, "RS00 user manual", section 4. moteus: mjbots/moteus
//! 00d474b0, `docs/reference.md`, section A. ODrive: odriverobotics/ODrive, `docs/can-protocol.rst`,
//! and ODrive documentation, "CAN Protocol" of firmware 0.6. Recoil: uncertainty-cc/
//! Recoil-Motor-Controller, `motor_controller.h`.

use crate::bus::can::{Form, Peer};
use crate::wire::can::CanFrame;
use gaitway_profiles::Dialect;
use std::f64::consts::TAU;

/// A numbered setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its number: register, index, address, or half of a message.
    pub number: u16,
    /// The maker's name.
    pub name: &'static str,
    /// SI unit; empty for a number without one.
    pub unit: &'static str,
    /// How it travels.
    pub form: Form,
    /// What may be done to it.
    pub access: Access,
    /// SI units in one of the device's.
    scale: f64,
}

/// What may be done to a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It tells only.
    Tells,
    /// It may be written.
    Set,
    /// It moves the actuator: only the guard's commands may.
    Goal,
    /// It switches the actuator on or off.
    Torque,
    /// It decides under which id the actuator is found.
    Identity,
    /// It decides at which speed the actuator is found.
    LineSpeed,
}

impl Parameter {
    /// The value of `bits` in SI units.
    #[must_use]
    pub fn si_from_bits(&self, bits: u32) -> f64 {
        match self.form {
            Form::Whole => f64::from(bits) * self.scale,
            Form::Float => f64::from(f32::from_bits(bits)) * self.scale,
        }
    }

    /// The bits of a value in SI units; none if it does not fit.
    #[must_use]
    pub fn bits_from_si(&self, si: f64) -> Option<u32> {
        let own = si / self.scale;
        match self.form {
            Form::Float => Some(own as f32).filter(|x| x.is_finite()).map(f32::to_bits),
            Form::Whole => {
                let nearest = own.round();
                // Whole numbers without a unit are not rounded silently.
                let exact = !self.unit.is_empty() || (own - nearest).abs() < 1e-9;
                let fits = (0.0..=f64::from(u32::MAX)).contains(&nearest);
                (exact && fits).then_some(nearest as u32)
            }
        }
    }

    /// The value of `bits` as the device counts it.
    #[must_use]
    pub fn raw_from_bits(&self, bits: u32) -> f64 {
        match self.form {
            Form::Whole => f64::from(bits),
            Form::Float => f64::from(f32::from_bits(bits)),
        }
    }

    /// The bits of a value as the device counts it; none if it does not fit.
    #[must_use]
    pub fn bits_from_raw(&self, raw: f64) -> Option<u32> {
        match self.form {
            Form::Float => Some(raw as f32).filter(|x| x.is_finite()).map(f32::to_bits),
            Form::Whole => {
                let fits = raw.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&raw);
                fits.then_some(raw as u32)
            }
        }
    }

    /// The frame that writes it until power-off. None for what moves, switches or only tells, and
    /// where the dialect has none.
    #[must_use]
    pub fn write(&self, peer: &Peer, bits: u32) -> Option<CanFrame> {
        match self.access {
            Access::Set | Access::Identity => peer.write(self.number, bits),
            Access::Tells | Access::Goal | Access::Torque | Access::LineSpeed => None,
        }
    }

    const fn whole(number: u16, name: &'static str, access: Access) -> Self {
        Self { number, name, unit: "", form: Form::Whole, access, scale: 1.0 }
    }

    /// A whole number of steps of `step` each.
    const fn steps(number: u16, name: &'static str, unit: &'static str, step: f64) -> Self {
        Self { number, name, unit, form: Form::Whole, access: Access::Set, scale: step }
    }

    const fn float(number: u16, name: &'static str, unit: &'static str, access: Access) -> Self {
        Self { number, name, unit, form: Form::Float, access, scale: 1.0 }
    }

    /// A number of revolutions.
    const fn turns(number: u16, name: &'static str, unit: &'static str, access: Access) -> Self {
        Self { number, name, unit, form: Form::Float, access, scale: TAU }
    }
}

/// All settings of a dialect, in order of their numbers; empty where it has none.
#[must_use]
pub const fn parameters(dialect: Dialect) -> &'static [Parameter] {
    match dialect {
        Dialect::Damiao => &DAMIAO,
        Dialect::Robstride => &ROBSTRIDE,
        Dialect::Odrive => &ODRIVE,
        Dialect::Moteus => &MOTEUS,
        Dialect::Recoil => &RECOIL,
        Dialect::CubemarsMit | Dialect::CubemarsServo => &[],
    }
}

use Access::{Goal, Identity, LineSpeed, Set, Tells, Torque};

/// Steps of a timeout in which Damiao and RobStride count, s.
const TIMEOUT_STEP_S: f64 = 50e-6;

const DAMIAO: [Parameter; 46] = [
    Parameter::float(0, "UV_Value", "V", Set),
    Parameter::float(1, "KT_Value", "N m/A", Tells),
    Parameter::float(2, "OT_Value", "degC", Set),
    Parameter::float(3, "OC_Value", "", Set),
    Parameter::float(4, "ACC", "rad/s2", Set),
    Parameter::float(5, "DEC", "rad/s2", Set),
    Parameter::float(6, "MAX_SPD", "rad/s", Set),
    Parameter::whole(7, "MST_ID", Identity),
    Parameter::whole(8, "ESC_ID", Identity),
    Parameter::steps(9, "TIMEOUT", "s", TIMEOUT_STEP_S),
    Parameter::whole(10, "CTRL_MODE", Set),
    Parameter::float(11, "Damp", "", Tells),
    Parameter::float(12, "Inertia", "", Tells),
    Parameter::whole(13, "hw_ver", Tells),
    Parameter::whole(14, "sw_ver", Tells),
    Parameter::whole(15, "SN", Tells),
    Parameter::whole(16, "NPP", Tells),
    Parameter::float(17, "Rs", "ohm", Tells),
    Parameter::float(18, "Ls", "H", Tells),
    Parameter::float(19, "Flux", "Wb", Tells),
    Parameter::float(20, "Gr", "", Tells),
    Parameter::float(21, "PMAX", "rad", Set),
    Parameter::float(22, "VMAX", "rad/s", Set),
    Parameter::float(23, "TMAX", "N m", Set),
    Parameter::float(24, "I_BW", "", Set),
    Parameter::float(25, "KP_ASR", "", Set),
    Parameter::float(26, "KI_ASR", "", Set),
    Parameter::float(27, "KP_APR", "", Set),
    Parameter::float(28, "KI_APR", "", Set),
    Parameter::float(29, "OV_Value", "V", Set),
    Parameter::float(30, "GREF", "", Set),
    Parameter::float(31, "Deta", "", Set),
    Parameter::float(32, "V_BW", "", Set),
    Parameter::float(33, "IQ_c1", "", Set),
    Parameter::float(34, "VL_c1", "", Set),
    Parameter::whole(35, "can_br", LineSpeed),
    Parameter::whole(36, "sub_ver", Tells),
    Parameter::float(50, "u_off", "", Tells),
    Parameter::float(51, "v_off", "", Tells),
    Parameter::float(52, "k1", "", Tells),
    Parameter::float(53, "k2", "", Tells),
    Parameter::float(54, "m_off", "", Tells),
    Parameter::float(55, "dir", "", Tells),
    Parameter::float(60, "VBus", "V", Tells),
    Parameter::float(80, "p_m", "rad", Tells),
    Parameter::float(81, "xout", "rad", Tells),
];

const ROBSTRIDE: [Parameter; 21] = [
    Parameter::steps(0x200C, "CyberGear CAN timeout", "s", TIMEOUT_STEP_S),
    Parameter::whole(0x7005, "run_mode", Set),
    Parameter::float(0x7006, "iq_ref", "A", Goal),
    Parameter::float(0x700A, "spd_ref", "rad/s", Goal),
    Parameter::float(0x700B, "limit_torque", "N m", Set),
    Parameter::float(0x7010, "cur_kp", "", Set),
    Parameter::float(0x7011, "cur_ki", "", Set),
    Parameter::float(0x7014, "cur_filt_gain", "", Set),
    Parameter::float(0x7016, "loc_ref", "rad", Goal),
    Parameter::float(0x7017, "limit_spd", "rad/s", Set),
    Parameter::float(0x7018, "limit_cur", "A", Set),
    Parameter::float(0x7019, "mechPos", "rad", Tells),
    Parameter::float(0x701A, "iqf", "A", Tells),
    Parameter::float(0x701B, "mechVel", "rad/s", Tells),
    Parameter::float(0x701C, "VBUS", "V", Tells),
    Parameter::whole(0x701D, "rotation", Tells),
    Parameter::float(0x701E, "loc_kp", "", Set),
    Parameter::float(0x701F, "spd_kp", "", Set),
    Parameter::float(0x7020, "spd_ki", "", Set),
    Parameter::float(0x7021, "spd_filt_gain", "", Set),
    Parameter::steps(0x7028, "CAN_TIMEOUT", "s", TIMEOUT_STEP_S),
];

/// Messages that both generations of firmware have: their limits and gains are told, and never
/// asked for.
const ODRIVE: [Parameter; 6] = [
    Parameter::turns(0x09 << 1, "pos_estimate", "rad", Tells),
    Parameter::turns(0x09 << 1 | 1, "vel_estimate", "rad/s", Tells),
    Parameter::float(0x14 << 1, "iq_setpoint", "A", Tells),
    Parameter::float(0x14 << 1 | 1, "iq_measured", "A", Tells),
    Parameter::float(0x17 << 1, "bus_voltage", "V", Tells),
    Parameter::float(0x17 << 1 | 1, "bus_current", "A", Tells),
];

const MOTEUS: [Parameter; 27] = [
    Parameter::whole(0x000, "mode", Torque),
    Parameter::turns(0x001, "position", "rad", Tells),
    Parameter::turns(0x002, "velocity", "rad/s", Tells),
    Parameter::float(0x003, "torque", "N m", Tells),
    Parameter::float(0x004, "q_current", "A", Tells),
    Parameter::float(0x005, "d_current", "A", Tells),
    Parameter::turns(0x006, "abs_position", "rad", Tells),
    Parameter::float(0x00A, "motor_temperature", "degC", Tells),
    Parameter::whole(0x00B, "trajectory_complete", Tells),
    Parameter::whole(0x00C, "home_state", Tells),
    Parameter::float(0x00D, "voltage", "V", Tells),
    Parameter::float(0x00E, "temperature", "degC", Tells),
    Parameter::whole(0x00F, "fault", Tells),
    Parameter::turns(0x020, "command_position", "rad", Goal),
    Parameter::turns(0x021, "command_velocity", "rad/s", Goal),
    Parameter::float(0x022, "command_feedforward_torque", "N m", Goal),
    Parameter::float(0x023, "command_kp_scale", "", Goal),
    Parameter::float(0x024, "command_kd_scale", "", Goal),
    Parameter::float(0x025, "command_max_torque", "N m", Goal),
    Parameter::turns(0x026, "command_stop_position", "rad", Goal),
    Parameter::float(0x027, "command_timeout", "s", Goal),
    Parameter::whole(0x100, "model_number", Tells),
    Parameter::whole(0x101, "firmware_version", Tells),
    Parameter::whole(0x102, "register_map_version", Tells),
    Parameter::whole(0x120, "serial_number_1", Tells),
    Parameter::whole(0x121, "serial_number_2", Tells),
    Parameter::whole(0x122, "serial_number_3", Tells),
];

const RECOIL: [Parameter; 18] = [
    Parameter::whole(0x000, "device_id", Identity),
    Parameter::whole(0x004, "firmware_version", Tells),
    Parameter::steps(0x008, "watchdog_timeout", "s", 1e-3),
    Parameter::steps(0x00C, "fast_frame_frequency", "Hz", 1.0),
    Parameter::whole(0x010, "mode", Torque),
    Parameter::whole(0x014, "error", Tells),
    Parameter::float(0x01C, "gear_ratio", "", Set),
    Parameter::float(0x020, "position_kp", "N m/rad", Set),
    Parameter::float(0x024, "position_ki", "N m/(rad s)", Set),
    Parameter::float(0x028, "velocity_kp", "N m s/rad", Set),
    Parameter::float(0x030, "torque_limit", "N m", Set),
    Parameter::float(0x034, "velocity_limit", "rad/s", Set),
    Parameter::float(0x038, "position_limit_lower", "rad", Set),
    Parameter::float(0x03C, "position_limit_upper", "rad", Set),
    Parameter::float(0x048, "torque_measured", "N m", Tells),
    Parameter::float(0x054, "velocity_measured", "rad/s", Tells),
    Parameter::float(0x060, "position_measured", "rad", Tells),
    Parameter::float(0x100, "bus_voltage", "V", Tells),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn named(dialect: Dialect, name: &str) -> Parameter {
        let all = parameters(dialect);
        *all.iter().find(|parameter| parameter.name == name).unwrap_or_else(|| panic!("{name}"))
    }

    #[test]
    fn numbers_and_names_are_each_used_once() {
        for dialect in
            [Dialect::Damiao, Dialect::Robstride, Dialect::Odrive, Dialect::Moteus, Dialect::Recoil]
        {
            let all = parameters(dialect);
            for pair in all.windows(2) {
                assert!(pair[0].number < pair[1].number, "{}", pair[1].name);
            }
            for (k, one) in all.iter().enumerate() {
                assert!(!all[..k].iter().any(|other| other.name == one.name), "{}", one.name);
            }
        }
    }

    #[test]
    fn steps_and_turns_become_si_units_and_back() {
        // 400 steps of 50 us are 20 ms (Damiao's register 9).
        let timeout = named(Dialect::Damiao, "TIMEOUT");
        assert!((timeout.si_from_bits(400) - 0.02).abs() < 1e-12);
        assert_eq!(timeout.bits_from_si(0.02), Some(400));
        assert_eq!(timeout.bits_from_si(-1.0), None);
        assert_eq!(timeout.bits_from_si(f64::NAN), None);
        // A quarter of a turn.
        let position = named(Dialect::Moteus, "position");
        let quarter = position.si_from_bits(0.25_f32.to_bits());
        assert!((quarter - core::f64::consts::FRAC_PI_2).abs() < 1e-9);
        assert_eq!(position.bits_from_si(quarter), Some(0.25_f32.to_bits()));
        assert_eq!(position.bits_from_si(1e300), None);
    }

    #[test]
    fn a_count_is_not_rounded() {
        let mode = named(Dialect::Damiao, "CTRL_MODE");
        assert_eq!(mode.bits_from_si(2.0), Some(2));
        assert_eq!(mode.bits_from_si(1.5), None);
    }

    #[test]
    fn whatever_moves_or_switches_is_no_setting() {
        for (dialect, name, access) in [
            (Dialect::Robstride, "loc_ref", Goal),
            (Dialect::Robstride, "spd_ref", Goal),
            (Dialect::Robstride, "iq_ref", Goal),
            (Dialect::Moteus, "command_position", Goal),
            (Dialect::Moteus, "mode", Torque),
            (Dialect::Recoil, "mode", Torque),
            (Dialect::Damiao, "ESC_ID", Identity),
        ] {
            assert_eq!(named(dialect, name).access, access, "{name}");
        }
    }
}
