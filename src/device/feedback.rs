//! What is read from a servo: motion in every cycle, health in turn.

use super::registers::{Model, RegisterError};
use gaitway_profiles::{Register, Role};

/// One joint as its servo reported it, in the servo's own sense of rotation. Absent: not read in
/// this exchange, or the model has no such register.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointState {
    /// Angle, rad.
    pub position_rad: f64,
    /// Speed, rad/s.
    pub velocity_rad_s: Option<f64>,
    /// Motor current, A.
    pub current_a: Option<f64>,
    /// Output as a share of full drive.
    pub load_ratio: Option<f64>,
    /// Supply voltage at the servo, V.
    pub voltage_v: Option<f64>,
    /// Temperature inside, degrees Celsius.
    pub temperature_c: Option<f64>,
}

/// Slow facts read from one servo per cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Health {
    /// True if the servo drives its motor.
    pub torque_on: Option<bool>,
    /// Error bits; zero = none. What they mean is told by the device's profile or dialect.
    pub error_bits: Option<u16>,
    /// Supply voltage at the servo, V.
    pub voltage_v: Option<f64>,
    /// Temperature inside, degrees Celsius.
    pub temperature_c: Option<f64>,
}

/// Registers read together in one go: the shortest run of bytes that holds them all.
#[derive(Clone, Debug)]
struct Block {
    address: u16,
    length: u16,
    registers: Vec<(Role, &'static Register)>,
}

impl Block {
    /// The block over those of `roles` that the model has; `None` if it has none.
    fn over(model: &Model, roles: &[Role]) -> Option<Self> {
        let registers: Vec<_> =
            roles.iter().filter_map(|&role| Some((role, model.register(role).ok()?))).collect();
        let address = registers.iter().map(|(_, r)| r.address).min()?;
        let end = registers.iter().map(|(_, r)| r.address + u16::from(r.bytes)).max()?;
        Some(Self { address, length: end - address, registers })
    }

    /// The bytes of `register`, given those of the block.
    fn bytes<'a>(&self, register: &Register, block: &'a [u8]) -> &'a [u8] {
        block.get(usize::from(register.address - self.address)..).unwrap_or(&[])
    }
}

/// The registers read from every servo in every cycle.
#[derive(Clone, Debug)]
pub struct FeedbackBlock {
    model: Model,
    block: Block,
}

/// What lies further than this from the position is not worth the bytes between, every cycle.
const REACH_BYTES: u16 = 16;

impl FeedbackBlock {
    /// Position, velocity and current (or load) of `model`, as far as they lie together.
    ///
    /// # Errors
    /// [`RegisterError::NoSuchRole`] if it does not report a position or a velocity.
    pub fn of(model: Model) -> Result<Self, RegisterError> {
        model.register(Role::PresentVelocity)?;
        let position = model.register(Role::PresentPosition)?;
        let wanted =
            [Role::PresentPosition, Role::PresentVelocity, Role::PresentCurrent, Role::PresentLoad];
        let near = |role: &Role| {
            let register = model.register(*role);
            register.is_ok_and(|r| r.address.abs_diff(position.address) <= REACH_BYTES)
        };
        Self::over(model, &wanted.into_iter().filter(near).collect::<Vec<_>>())
    }

    /// Position alone.
    ///
    /// # Errors
    /// As [`FeedbackBlock::of`].
    pub fn position_of(model: Model) -> Result<Self, RegisterError> {
        Self::over(model, &[Role::PresentPosition])
    }

    fn over(model: Model, roles: &[Role]) -> Result<Self, RegisterError> {
        let block = Block::over(&model, roles).ok_or_else(|| RegisterError::NoSuchRole {
            servo: model.profile().name.clone(),
            role: Role::PresentPosition,
        })?;
        Ok(Self { model, block })
    }

    /// First address.
    #[must_use]
    pub const fn address(&self) -> u16 {
        self.block.address
    }

    /// Number of bytes.
    #[must_use]
    pub const fn length(&self) -> u16 {
        self.block.length
    }

    /// The state in `bytes`, with whatever slow facts happen to lie inside the block.
    ///
    /// # Errors
    /// [`RegisterError::Short`].
    pub fn decode(&self, bytes: &[u8]) -> Result<JointState, RegisterError> {
        let mut state = JointState::default();
        for (role, register) in &self.block.registers {
            let si = self.model.si_from_bytes(register, self.block.bytes(register, bytes))?;
            match role {
                Role::PresentPosition => state.position_rad = si,
                Role::PresentVelocity => state.velocity_rad_s = Some(si),
                Role::PresentCurrent => state.current_a = Some(si),
                _ => state.load_ratio = Some(si),
            }
        }
        for (role, slot) in [
            (Role::PresentVoltage, &mut state.voltage_v),
            (Role::PresentTemperature, &mut state.temperature_c),
        ] {
            let Ok(register) = self.model.register(role) else { continue };
            if register.address >= self.block.address {
                let own = self.block.bytes(register, bytes);
                *slot = self.model.si_from_bytes(register, own).ok();
            }
        }
        Ok(state)
    }
}

/// Slow registers, read from one servo per cycle in turn. Far apart in some tables, hence blocks.
#[derive(Clone, Debug)]
pub struct HealthBlock {
    model: Model,
    blocks: Vec<Block>,
}

impl HealthBlock {
    /// Torque and error state, voltage and temperature of `model`.
    #[must_use]
    pub fn of(model: Model) -> Self {
        // Torque and error state apart: a read across undefined addresses may be refused.
        let groups: [&[Role]; 3] = [
            &[Role::TorqueEnable],
            &[Role::HardwareError],
            &[Role::PresentVoltage, Role::PresentTemperature],
        ];
        let blocks = groups.iter().filter_map(|roles| Block::over(&model, roles)).collect();
        Self { model, blocks }
    }

    /// Address and length of each block, in turn.
    #[must_use]
    pub fn reads(&self) -> Vec<(u16, u16)> {
        self.blocks.iter().map(|block| (block.address, block.length)).collect()
    }

    /// The facts in the bytes of block number `index`.
    ///
    /// # Errors
    /// [`RegisterError::Short`].
    pub fn decode(&self, index: usize, bytes: &[u8]) -> Result<Health, RegisterError> {
        let mut health = Health::default();
        let Some(block) = self.blocks.get(index) else { return Ok(health) };
        for (role, register) in &block.registers {
            let own = block.bytes(register, bytes);
            let raw = self.model.raw_from_bytes(register, own)?;
            let si = self.model.si_from_raw(register, raw);
            match role {
                Role::TorqueEnable => health.torque_on = Some(raw == 1),
                Role::HardwareError => health.error_bits = u16::try_from(raw).ok(),
                Role::PresentVoltage => health.voltage_v = Some(si),
                _ => health.temperature_c = Some(si),
            }
        }
        Ok(health)
    }
}
