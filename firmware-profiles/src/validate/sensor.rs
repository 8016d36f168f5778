//! Rules of sensor files.

use super::{Verdict, finite, header, not_empty, positive, unique};
use crate::error::ProfileError;
use crate::schema::{Channel, Quantity, Sensor, SensorProtocol, hex_bytes};

/// Longest command, bytes.
const COMMAND_BYTES: usize = 256;

pub(crate) fn sensor(file: &str, sensor: &Sensor) -> Verdict {
    header(file, sensor.schema, &sensor.name)?;
    not_empty(file, "model", &sensor.model)?;
    not_empty(file, "maker", &sensor.maker)?;
    not_empty(file, "source", &sensor.source)?;
    positive(file, || "rate_hz".to_owned(), sensor.rate_hz)?;
    if !(0.0..=1.0).contains(&sensor.latency_s) {
        return Err(ProfileError::new(file, "the latency is no time a transport takes")
            .at("latency_s")
            .got(sensor.latency_s)
            .allowed("0 to 1 s"));
    }
    line_speed(file, sensor)?;
    axes(file, sensor)?;
    for (place, commands) in [("start", &sensor.start), ("stop", &sensor.stop)] {
        for command in commands {
            let bytes = hex_bytes(command).map_or(0, |bytes| bytes.len());
            if !(1..=COMMAND_BYTES).contains(&bytes) {
                return Err(ProfileError::new(file, "this is not a command")
                    .at(place)
                    .got(format!("{command:?}"))
                    .allowed(format!("1 to {COMMAND_BYTES} bytes in hexadecimal")));
            }
        }
    }
    clocks(file, sensor)?;
    columns(file, sensor)?;
    channels(file, sensor)
}

fn line_speed(file: &str, sensor: &Sensor) -> Verdict {
    let udp = matches!(sensor.protocol, SensorProtocol::Slimevr | SensorProtocol::Natnet);
    match sensor.baud_bps {
        None if udp => Ok(()),
        Some(1..) if !udp => Ok(()),
        got => Err(ProfileError::new(file, "the line speed does not fit the protocol")
            .at("baud_bps")
            .got(got.map_or("none".to_owned(), |baud| baud.to_string()))
            .allowed(if udp { "none: this protocol has no serial line" } else { "1 or more" })),
    }
}

/// The axes must be a turn of the sensor's own: each once, and right-handed.
fn axes(file: &str, sensor: &Sensor) -> Verdict {
    let [x, y, z] = sensor.axes.map(|axis| axis.unit());
    let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    if cross == z {
        return Ok(());
    }
    Err(ProfileError::new(file, "the axes are not right-handed")
        .at("axes")
        .got(format!("{:?}", sensor.axes))
        .allowed("three different axes with X x Y = Z, e.g. [\"x\", \"-y\", \"-z\"]"))
}

fn clocks(file: &str, sensor: &Sensor) -> Verdict {
    let widths = [
        ("counter.bits", sensor.counter.map(|counter| counter.bits)),
        ("clock.bits", sensor.clock.map(|clock| clock.bits)),
    ];
    for (place, bits) in widths {
        if bits.is_some_and(|bits| !(4..=64).contains(&bits)) {
            return Err(ProfileError::new(file, "no counter has this width")
                .at(place)
                .got(bits.unwrap_or(0))
                .allowed("4 to 64"));
        }
    }
    match sensor.clock {
        Some(clock) => positive(file, || "clock.tick_s".to_owned(), clock.tick_s),
        None => Ok(()),
    }
}

fn columns(file: &str, sensor: &Sensor) -> Verdict {
    use SensorProtocol::{Cobs, Lines, Slip};
    let text = sensor.protocol == Lines;
    let framed = matches!(sensor.protocol, Cobs | Slip);
    if (text || framed) == sensor.columns.is_empty() || (!text && sensor.line.is_some()) {
        return Err(ProfileError::new(file, "columns and protocol do not fit")
            .at("columns")
            .allowed("columns for lines, cobs and slip only; `line` for lines only"));
    }
    for column in &sensor.columns {
        let (name, number) = column.split_once(':').unwrap_or((column, ""));
        let known = Sensor::COLUMNS.contains(&name);
        if !known || (text && !number.is_empty()) || (framed && !Sensor::NUMBERS.contains(&number))
        {
            let numbers = if framed {
                format!(", each with one of :{}", Sensor::NUMBERS.join(" :"))
            } else {
                String::new()
            };
            return Err(ProfileError::new(file, "this is no column")
                .at("columns")
                .got(format!("{column:?}"))
                .allowed(format!("{}{numbers}", Sensor::COLUMNS.join(" "))));
        }
    }
    unique(file, "column", "columns", sensor.columns.iter().filter(|name| !name.starts_with('-')))
}

fn channels(file: &str, sensor: &Sensor) -> Verdict {
    for channel in &sensor.channels {
        self::channel(file, sensor.protocol, channel)?;
    }
    let names = sensor.channels.iter().map(|channel| format!("{:?}", channel.quantity));
    unique(file, "quantity", "channel", names)?;
    if sensor.channels.iter().all(|channel| channel.optional) {
        return Err(ProfileError::new(file, "nothing makes a sample whole")
            .at("channel")
            .allowed("at least one channel that is not optional"));
    }
    Ok(())
}

fn channel(file: &str, protocol: SensorProtocol, channel: &Channel) -> Verdict {
    let place = |field: &str| format!("channel {:?}, {field}", channel.quantity);
    not_empty(file, &place("source"), &channel.source)?;
    if !channel.unit.fits(channel.quantity) {
        return Err(ProfileError::new(file, "the quantity has another unit")
            .at(place("unit"))
            .got(format!("{:?}", channel.unit)));
    }
    if !carries(protocol, channel.quantity) {
        return Err(ProfileError::new(file, "the protocol does not carry this quantity")
            .at(place("quantity"))
            .got(format!("{protocol:?}")));
    }
    finite(file, || place("scale"), channel.scale)?;
    if channel.scale == 0.0 {
        return Err(ProfileError::new(file, "a scale of zero hides everything").at(place("scale")));
    }
    for (field, value) in [("range", channel.range), ("noise", channel.noise)] {
        if let Some(value) = value {
            positive(file, || place(field), value)?;
        }
    }
    Ok(())
}

/// What a protocol can say at all.
fn carries(protocol: SensorProtocol, quantity: Quantity) -> bool {
    use Quantity as Q;
    use SensorProtocol as P;
    match protocol {
        P::Bno08xRvc => matches!(quantity, Q::Acceleration | Q::Euler),
        P::MpuTeapot | P::Natnet => quantity == Q::Orientation,
        P::Slimevr => {
            matches!(quantity, Q::LinearAcceleration | Q::Orientation | Q::Temperature)
        }
        P::Witmotion
        | P::WitmotionBle
        | P::Xsens
        | P::VectornavBinary
        | P::VectornavAscii
        | P::XImu3
        | P::Lines
        | P::Cobs
        | P::Slip => quantity != Q::LinearAcceleration,
    }
}
