//! A virtual person in virtual sensors: one who performs what was planned, or one who takes part in a session.

use super::imus::{ImusOrder, OpenSensor, SensorDoors, Wearer};
use super::participant::{FollowOrder, Participant};
use crate::body::segment_name;
use crate::error::Error;

/// Somebody whose sensors can be opened. Dropping it ends them.
pub struct VirtualPerson {
    who: Who,
    /// What is worth typing next, in another terminal.
    next: Option<String>,
}

enum Who {
    /// With what was done when somebody looked last.
    Performs(Box<Wearer>, Option<&'static str>),
    Follows(Box<Participant>),
}

/// Reads which motion an action of a session is: `NAME=MOTION`.
///
/// # Errors
/// Anything else.
pub fn named_motion(text: &str) -> Result<(String, String), Error> {
    let pair = text.split_once('=').filter(|(name, motion)| !name.is_empty() && !motion.is_empty());
    let (name, motion) = pair.ok_or_else(|| {
        Error::new("not the motion of an action").got(text).allowed("NAME=MOTION")
    })?;
    Ok((name.to_owned(), motion.to_owned()))
}

impl VirtualPerson {
    /// Somebody who does what `order` says, or who takes part in the session that `follow` names.
    ///
    /// # Errors
    /// As [`Wearer::open`] and [`Participant::open`].
    pub fn open(order: &ImusOrder, follow: Option<FollowOrder>) -> Result<Self, Error> {
        let Some(follow) = follow else {
            let wearer = Wearer::open(order)?;
            let next = wearer.wear_file().map(|path| {
                let path = path.display();
                format!("gaitway live --wear {path} --robot op3 --bus sim:pty --n-pose-after 1s --moves bow")
            });
            return Ok(Self { who: Who::Performs(Box::new(wearer), None), next });
        };
        let session = follow.session.display().to_string();
        let participant = Participant::open(order, follow)?;
        let source = |sensor: &OpenSensor| {
            let (segment, place) = (segment_name(sensor.segment), &sensor.place);
            match order.doors {
                SensorDoors::Terminals(_) => format!("{segment}=imu:{}@{place}", order.profile),
                SensorDoors::SlimeVr(_) => format!("--wear {segment}={place}"),
            }
        };
        let mut sources: Vec<String> = participant.sensors().iter().map(source).collect();
        if let SensorDoors::SlimeVr(server) = &order.doors {
            sources.insert(0, format!("imu:slimevr@udp:{server}"));
        }
        let next = Some(format!("gaitway record --session {session} {}", sources.join(" ")));
        Ok(Self { who: Who::Follows(Box::new(participant)), next })
    }

    /// Every sensor, in the order of the segments that were given.
    #[must_use]
    pub fn sensors(&self) -> &[OpenSensor] {
        match &self.who {
            Who::Performs(wearer, _) => wearer.sensors(),
            Who::Follows(participant) => participant.sensors(),
        }
    }

    /// A command that goes with it, to be typed in another terminal, if there is one.
    #[must_use]
    pub fn next(&self) -> Option<&str> {
        self.next.as_deref()
    }

    /// Lets somebody who takes part do what is asked now; to be called some twenty times a second. Gives what is done from now
    /// on, a line each.
    pub fn attend(&mut self) -> Vec<String> {
        match &mut self.who {
            Who::Performs(wearer, before) => {
                let now = wearer.doing();
                let is_new = std::mem::replace(before, now) != now;
                let line = now.unwrap_or("nobody listens").to_owned();
                if is_new { vec![line] } else { Vec::new() }
            }
            Who::Follows(participant) => participant.attend(),
        }
    }
}
