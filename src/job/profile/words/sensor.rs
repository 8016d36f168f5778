//! `profile show` of a sensor.

use crate::error::counted;
use gaitway_profiles::{Channel, Sensor};
use std::fmt::Write;

pub(super) fn show(sensor: &Sensor) -> String {
    let mut out = format!(
        "{} {}\nsource   {}\nstream   {}, {} samples/s",
        sensor.maker,
        sensor.model,
        sensor.source,
        super::words(sensor.protocol),
        sensor.rate_hz
    );
    if let Some(baud_bps) = sensor.baud_bps {
        let _ = write!(out, ", {baud_bps} bit/s");
    }
    let _ = write!(out, "\naxes     {}", sensor.axes.map(super::words).join(", "));
    let _ = writeln!(out, "; world {}", super::words(sensor.world));
    if let Some(counter) = sensor.counter {
        let _ = writeln!(out, "counter  {}", counted(counter.bits, "bit"));
    }
    if let Some(clock) = sensor.clock {
        let _ =
            writeln!(out, "clock    {} of {} us", counted(clock.bits, "bit"), clock.tick_s * 1e6);
    }
    for (word, commands) in [("start", &sensor.start), ("stop", &sensor.stop)] {
        for command in commands {
            let _ = writeln!(out, "{word:<8} {command}");
        }
    }
    if !sensor.columns.is_empty() {
        let _ = writeln!(out, "columns  {}", sensor.columns.join(", "));
    }
    let _ = writeln!(
        out,
        "\n{:<20} {:>14} {:>7} {:>12} {:>12}",
        "channel", "one count", "unit", "range", "noise"
    );
    for channel in &sensor.channels {
        let _ = writeln!(out, "{}", row(channel));
    }
    out
}

fn row(channel: &Channel) -> String {
    let said = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| value.to_string());
    let row = format!(
        "{:<20} {:>14.8} {:>7} {:>12} {:>12} {}",
        super::words(channel.quantity),
        channel.scale,
        channel.unit.symbol(),
        said(channel.range),
        said(channel.noise),
        if channel.optional { "optional" } else { "" }
    );
    row.trim_end().to_owned()
}
