//! What is fuzzed: one module each, with one function that takes any bytes.

/// Modules, and each one's function by its name.
macro_rules! targets {
    ($($name:ident),* $(,)?) => {
        $(mod $name;)*

        /// What the target of this name does with bytes.
        pub fn named(name: &str) -> Option<fn(&[u8])> {
            match name {
                $(stringify!($name) => Some($name::fuzz),)*
                _ => None,
            }
        }
    };
}

targets!(
    acclaim,
    bus_answers,
    c3d,
    can_lines,
    control_requests,
    dynamixel1_status,
    dynamixel2_merged,
    dynamixel2_status,
    fault_scripts,
    feetech_status,
    marker_texts,
    motions,
    profiles,
    recordings,
    sensor_streams,
    texts,
    virtual_servos,
);
