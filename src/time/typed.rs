//! Times as they are typed.

use super::Duration;

/// `10s`, `2.5s`, `500ms`, `2min`.
///
/// # Errors
/// What is no time, or none above zero.
pub fn duration(text: &str) -> Result<Duration, String> {
    let (number, unit_s) = if let Some(number) = text.strip_suffix("ms") {
        (number, 1e-3)
    } else if let Some(number) = text.strip_suffix("min") {
        (number, 60.0)
    } else {
        (text.strip_suffix('s').unwrap_or(text), 1.0)
    };
    let seconds = number.trim().parse::<f64>().map_err(|e| e.to_string())? * unit_s;
    if seconds > 0.0 && seconds <= 1e6 {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err("allowed are times above zero, e.g. 10s, 500ms, 2min".to_owned())
    }
}

/// A time for which something goes on: from a tenth of a second to a day.
///
/// # Errors
/// What is no time, or another one.
pub fn listening_time(text: &str) -> Result<Duration, String> {
    let time = duration(text)?;
    let allowed = Duration::from_millis(100)..=Duration::from_secs(86_400);
    if allowed.contains(&time) { Ok(time) } else { Err("0.1 to 86400 s".to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_units() {
        assert_eq!(duration("10s"), Ok(Duration::from_secs(10)));
        assert_eq!(duration("2.5"), Ok(Duration::from_millis(2500)));
        assert_eq!(duration("500ms"), Ok(Duration::from_millis(500)));
        assert_eq!(duration("2min"), Ok(Duration::from_secs(120)));
        for text in ["", "0s", "-1s", "nan", "1h"] {
            assert!(duration(text).is_err(), "{text}");
        }
    }
}
