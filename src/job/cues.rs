//! What is said to people whose sensors are heard and calibrated, in words.

use crate::body::segment_name;
use crate::body::worn::Movement;
use crate::body::worn::check::{T_POSE_FAIL_RAD, T_POSE_WARN_RAD};
use crate::error::counted;
use crate::job::{Event, source_words};
use crate::sensing::{Cue, Question, SensingEvent, Unseen, Until};
use crate::view::tracks::ViewSpan;
use crate::wire::natnet::COMMAND_PORT;

/// What a guide says.
pub fn of(cue: &Cue<'_>) -> String {
    match cue {
        Cue::Unused(names) => format!("nobody wears {}: not used", names.join(", ")),
        Cue::Note(text) => (*text).to_owned(),
        Cue::Doubt(text) => format!("look: {text}"),
        Cue::Old { hours, held_hours } => format!(
            "the calibration of the body is {hours} old, and held for {held_hours}: straps \
             move; --recalibrate makes a new one",
            hours = counted(hours, "hour")
        ),
        Cue::Again(error) => format!("{error}\nonce more"),
        Cue::NPose => "N pose: upright, arms down, palms in, facing forward".to_owned(),
        Cue::In(time) => format!("  in {:.0} s", time.as_secs_f64()),
        Cue::HoldStill(time) => format!("  hold still for {:.0} s", time.as_secs_f64()),
        Cue::Good => "  good".to_owned(),
        Cue::Moved { segment, rad } if rad.is_finite() => {
            format!("  {} moved ({:.1} deg): once more", segment_name(*segment), rad.to_degrees())
        }
        Cue::Moved { segment, .. } => {
            format!("  {} said nothing: once more", segment_name(*segment))
        }
        Cue::TPose => "T pose: arms straight out to the sides, palms down; hold".to_owned(),
        Cue::OffTPose { segment, rad } => {
            let word = match *rad {
                rad if rad <= T_POSE_WARN_RAD => "good",
                rad if rad <= T_POSE_FAIL_RAD => "look",
                _ => "too far",
            };
            let name = segment_name(*segment);
            format!("  {name:<16} {:5.1} deg off  {word}", rad.to_degrees())
        }
        Cue::Move(movement) => format!("then: {}", asked(*movement)),
        Cue::Next(Cue::Move(movement)) => asked(*movement).to_owned(),
        Cue::Next(cue) => of(cue),
        Cue::Waiting { until: Until::Begun, .. } => {
            "  it has not been begun yet; at a terminal s and Enter leaves it out".to_owned()
        }
        Cue::Waiting { until, segments } => {
            let (words, otherwise) = match until {
                Until::Up | Until::Begun => ("not up yet", ""),
                Until::Back => ("not back yet", "; at a terminal s and Enter leaves it out"),
            };
            let far = segments.iter().map(|(segment, rad)| {
                format!("{} ({:.0} deg from N pose)", segment_name(*segment), rad.to_degrees())
            });
            format!("  {words}: {}{otherwise}", far.collect::<Vec<_>>().join(", "))
        }
        Cue::Unseen(Unseen::TPose) => {
            "  no T pose was seen: the arms' headings are not checked".to_owned()
        }
        Cue::Unseen(Unseen::Movement) => "  it was not seen: left out".to_owned(),
        Cue::Ask(Question::Stands) => "  Enter when you stand so; q ends".to_owned(),
        Cue::Ask(Question::TPoseAgain) => "  Enter: once more; s: go on with it; q ends".to_owned(),
        Cue::Unknown(words) => format!("  {words:?}? Enter goes on, s skips, q ends"),
    }
}

/// What is told besides to whoever wants to know it all; each a line.
pub fn in_full(event: &Event<'_>) -> Vec<String> {
    match event {
        Event::Planned { duration_s, approach_s, retime_factor } => {
            let long = match duration_s.is_finite() {
                true => format!("{duration_s:.2} s"),
                false => "without end".to_owned(),
            };
            vec![format!(
                "planned: {long}, of it {approach_s:.2} s to the first pose; x {retime_factor:.3} as long as asked"
            )]
        }
        Event::Foreseen(spans) => {
            let words = |span: &ViewSpan| {
                let ViewSpan { row, label, start_s, end_s, .. } = span;
                let when = match end_s - start_s >= 0.01 {
                    true => format!("{start_s:.2} to {end_s:.2} s"),
                    false => format!("at {start_s:.2} s"),
                };
                format!("foreseen: {row}, {when}: {label}")
            };
            spans.iter().map(words).collect()
        }
        _ => Vec::new(),
    }
}

/// A movement as a person is asked for it.
const fn asked(movement: Movement) -> &'static str {
    match movement {
        Movement::Bow => "bow with a straight back, and come up again",
        Movement::SitToStand => "sit down and stand up again",
        Movement::Bend => {
            "march on the spot, feet pulled along, elbows bending, arms at the sides; then stand"
        }
        Movement::RaiseArms => "raise both straight arms forward and lower them",
    }
}

/// What happens to a source.
pub fn of_event(event: SensingEvent<'_>) -> String {
    match event {
        SensingEvent::NothingComes { sensor } => {
            format!("{sensor}: nothing comes; is it switched on, and are RX and TX crossed?")
        }
        SensingEvent::NoPackets { sensor, profile, baud_bps } => format!(
            "{sensor}: bytes come, but no packets of {profile}; check the line speed ({baud_bps} \
             bit/s) and the profile"
        ),
        SensingEvent::Gone { sensor, why } => format!("{sensor} is gone: {why}"),
        SensingEvent::Back { sensor, gone_s } => format!("{sensor} is back after {gone_s:.1} s"),
        SensingEvent::Stuck { sensor } => {
            format!("{sensor}: its values stand still, nothing is measured")
        }
        SensingEvent::Unstuck { sensor } => format!("{sensor}: measures again"),
        SensingEvent::Rate { sensor, rate_hz, profile_rate_hz } => {
            format!("{sensor} {}", source_words::rate(rate_hz, profile_rate_hz))
        }
        SensingEvent::OpenToNetwork { listen, worn, most } => {
            let whom = match worn.len() {
                0 => {
                    format!("the first {most} that call are heard", most = counted(most, "tracker"))
                }
                _ => format!("whoever says that it is one of these is heard: {}", worn.join(", ")),
            };
            format!("udp:{listen} is open to the network: {whom}")
        }
        SensingEvent::NoTracker { listen } if listen.ip().is_loopback() => {
            let port = listen.port();
            format!(
                "no tracker has called yet: udp:{port} listens to this machine alone; for trackers \
                 of the network it is udp:0.0.0.0:{port}, in a network you trust"
            )
        }
        SensingEvent::NoTracker { .. } => {
            "no tracker has called yet; is this machine in their network, and does its firewall \
             let UDP in?"
                .to_owned()
        }
        SensingEvent::TrackerRefused { why } => format!("a tracker is refused: {why}"),
        SensingEvent::Server { server, version } => {
            format!("NatNet {version} of {server} is heard")
        }
        SensingEvent::NoBody { at, server: false } if at.ip().is_multicast() => format!(
            "nothing comes to udp:{at} yet, or who sends there does not answer at its port {COMMAND_PORT}; does Motive stream, to \
             this group, on this network? udp:ADDRESS:{COMMAND_PORT} asks it there"
        ),
        SensingEvent::NoBody { at, server: false } => format!(
            "no server answers at udp:{at} yet; does Motive stream, on this network, and is that its command port \
             (usually {COMMAND_PORT})?"
        ),
        SensingEvent::NoBody { .. } => {
            "Motive answers, but no rigid body or bone that is worn comes; are they switched on in its Data Streaming, and does \
             a firewall let its frames in?"
                .to_owned()
        }
    }
}
